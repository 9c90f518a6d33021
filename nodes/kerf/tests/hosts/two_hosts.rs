//! A machine that is spread over two hosts, and the cable between them.

use super::alone::LISTEN;
use super::cable::Cable;
use super::commander::Commander;
use super::network::{Host, PORT, Process, RMW, SUBNET, until};
use super::support::{CONTOUR, Folder, Ran, TOOLS, run};
use std::path::Path;
use std::time::Duration;

/// The cell: loader, planner and commander in the office, the rest at the machine.
struct Cell {
    office: Host,
    shop: Host,
    folder: Folder,
    _nodes: Vec<Process>,
}

impl Cell {
    /// `None` where there are no hosts to be had.
    fn new(time_factor: &str, rmw: &'static str) -> Option<Self> {
        let (office, shop) = (Host::new()?.speaking(rmw), Host::new()?.speaking(rmw));
        Some(Self::of(office, shop, time_factor))
    }

    fn of(office: Host, shop: Host, time_factor: &str) -> Self {
        office.connect(&shop);
        let folder = Folder::new();
        let link = folder.path().join("controller");
        let table = format!("tool_table:={TOOLS}");
        let mut nodes = Vec::new();
        let mut start = |host: &Host, args: &[&str]| {
            let mut command = host.kerf(SUBNET, &[&["node"], args].concat());
            command.current_dir(folder.path());
            let log = folder.path().join(format!("{}.log", args[0]));
            nodes.push(Process::start(command, &log));
        };
        let link = link.to_str().expect("a path of ours is UTF-8");
        let at = match Cable::wanted() {
            Cable::Terminal => ["--link", link],
            // Each host has a loopback of its own.
            Cable::Tcp => ["--listen", LISTEN],
        };
        let port = format!("port:={}", at[1]);
        let controller = ["virtual_controller", "--time-factor", time_factor, at[0], at[1]];
        start(&shop, &controller);
        start(&shop, &["axis_driver", "--ros-args", "-p", &port, "-p", "poll_interval_ms:=500"]);
        start(&shop, &["run_recorder", "--ros-args", "-p", "directory:=bags"]);
        start(&office, &["program_loader"]);
        start(&office, &["compensation_planner", "--ros-args", "-p", &table]);
        let cell = Self { office, shop, folder, _nodes: nodes };
        cell.until_status(&cell.office, "IDLE");
        cell
    }

    fn kerf(&self, host: &Host, args: &[&str]) -> Ran {
        run(host.kerf(SUBNET, args).current_dir(self.folder.path()))
    }

    /// Waits until a host receives this state of the machine.
    #[track_caller]
    fn until_status(&self, host: &Host, state: &str) -> String {
        until(&format!("{state}; {}", self.logs()), || {
            let status = self.kerf(host, &["status"]);
            status.out.starts_with(state).then_some(status.out)
        })
    }

    fn logs(&self) -> String {
        let read = |name: &str| std::fs::read_to_string(self.folder.path().join(name));
        let names = ["axis_driver.log", "compensation_planner.log", "program_loader.log"];
        names.iter().filter_map(|name| read(name).ok()).collect()
    }
}

fn bags(folder: &Path) -> Vec<std::path::PathBuf> {
    let Ok(entries) = std::fs::read_dir(folder.join("bags")) else { return Vec::new() };
    let bags = entries.flatten().map(|entry| entry.path());
    bags.filter(|bag| bag.join("metadata.yaml").exists()).collect()
}

#[test]
fn nodes_on_two_hosts_load_plan_run_and_record() {
    for rmw in [RMW, "rmw_cyclonedds_cpp"] {
        let Some(cell) = Cell::new("50", rmw) else { return };
        // Contour, path and what the recorder fetches are answers of many packets.
        let moves: String = (0..2000).map(|n| format!("G1 X{} Y{}\n", 10 + n % 2, n % 3)).collect();
        let program = format!("G21 G90 G94 G17\nG0 X10 Y0\nF6000\n{moves}M30\n");
        cell.folder.file("long.ngc", program);
        cell.kerf(&cell.office, &["plan", "long.ngc", "--quiet"]).expect(0);
        cell.kerf(&cell.office, &["load", "long.ngc"]).expect(0);
        let args = ["run", CONTOUR, "--control", "sinumerik_840c"];
        cell.kerf(&cell.office, &args).expect(0).says(&["done"]);
        let bag = until("a bag", || bags(cell.folder.path()).pop());
        let bag = bag.to_str().expect("a path of ours is UTF-8");
        cell.kerf(&cell.shop, &["bag", "info", bag]).expect(0).says(&["complete:    yes"]);
        assert!(!cell.logs().contains("panicked"), "{}", cell.logs());
    }
}

#[test]
fn nodes_of_hosts_that_name_each_other_need_no_multicast() {
    for rmw in [RMW, "rmw_cyclonedds_cpp"] {
        let (Some(office), Some(shop)) = (Host::new(), Host::new()) else { return };
        let office = office.speaking(rmw).knowing("10.77.0.2");
        let shop = shop.speaking(rmw).knowing("10.77.0.1");
        let cell = Cell::of(office, shop, "50");
        let args = ["run", CONTOUR, "--control", "sinumerik_840c"];
        cell.kerf(&cell.office, &args).expect(0).says(&["done"]);
        // What DDS announces by multicast, 239.255.0.1 as this file writes it, is not joined on the cable.
        let groups = cell.office.proc_net("igmp");
        assert!(groups.split(PORT).nth(1).is_some_and(|it| !it.contains("0100FFEF")), "{groups}");
    }
}

#[test]
fn a_pulled_cable_holds_the_run_and_the_commander_resumes_it_when_it_is_back() {
    let Some(cell) = Cell::new("4", RMW) else { return };
    // Two minutes of machine time.
    let moves: String = (0..12).map(|_| "G1 X110\nG1 X10\n").collect();
    let program = format!("G21 G90 G94 G17\nG0 X10 Y10\nF1200\n{moves}M30\n");
    cell.folder.file("long.ngc", program);
    cell.kerf(&cell.office, &["load", "long.ngc"]).expect(0);
    let mut commander = Commander::start(&cell.office);
    let at = commander.until_sent(0, "state RUN");

    cell.office.ip(&format!("link set {PORT} down"));
    // The shop works without the office: the driver holds by itself, and reports it.
    let status = cell.until_status(&cell.shop, "HOLD");
    assert!(status.contains("COMMANDER_LOST"), "{status}");
    // It stays so, however long the cable is away.
    std::thread::sleep(Duration::from_secs(3));
    cell.until_status(&cell.shop, "HOLD");
    assert!(!commander.output()[at..].iter().any(|line| line.contains("HOLD")), "it cannot know");
    assert!(!commander.output().iter().any(|line| line.contains("result")), "the goal continues");

    cell.office.ip(&format!("link set {PORT} up"));
    let at = commander.until_sent(at, "state HOLD COMMANDER_LOST");
    // Nothing resumes by itself, signs of life or not.
    std::thread::sleep(Duration::from_secs(2));
    cell.until_status(&cell.shop, "HOLD");
    commander.press("resume");
    commander.until_sent(at, "success: true");
    let at = commander.until_sent(at, "state RUN");
    assert!(commander.is_alive());
    let end = commander.until_sent(at, "result");
    let result = commander.output()[end].clone();
    assert!(result.contains("outcome: 1"), "{result}");
    assert!(!cell.logs().contains("panicked"), "{}", cell.logs());
}
