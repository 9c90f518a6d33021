//! A machine that is to stay on its host: nothing leaves, nothing comes in.

use super::cable::Cable;
use super::network::{Host, PORT, Process, SUBNET, until};
use super::support::{CONTOUR, Folder, TOOLS, run};
use std::net::UdpSocket;
use std::process::Command;
use std::time::Duration;

/// Says to a process of this test program which ports it is to knock at.
const KNOCKS: &str = "KERF_TEST_KNOCKS";

/// Where a controller in a network listens.
pub(super) const LISTEN: &str = "tcp://127.0.0.1:7023";

/// The first port that the system gives to whoever asks for any.
const EPHEMERAL: u16 = 32_768;

/// The whole machine on a host, idle.
fn machine(host: &Host, range: &str, folder: &Folder) -> Process {
    let table = format!("compensation_planner:tool_table:={TOOLS}");
    let mut up = host.kerf(range, &["up", "--virtual-controller", "--time-factor", "50"]);
    if Cable::wanted() == Cable::Tcp {
        up.args(["--listen", LISTEN]);
    }
    up.args(["--ros-args", "-p", &table, "-p", "run_recorder:directory:=bags"]);
    up.args(["-p", "axis_driver:poll_interval_ms:=500"]);
    // It takes its nodes with it when its group is ended.
    up.current_dir(folder.path());
    let process = Process::start(up, &folder.path().join("up.log"));
    until("an idle machine", || {
        let status = run(&mut host.kerf(range, &["status"]));
        status.out.starts_with("IDLE").then_some(())
    });
    process
}

/// The UDP ports that are open on a host on all addresses.
fn open_ports(host: &Host) -> Vec<u16> {
    let sockets = host.proc_net("udp");
    let addresses = sockets.lines().skip(1).filter_map(|line| line.split_whitespace().nth(1));
    let everywhere = addresses.filter_map(|address| address.strip_prefix("00000000:"));
    let mut ports: Vec<u16> =
        everywhere.map(|port| u16::from_str_radix(port, 16).expect("a port")).collect();
    ports.sort_unstable();
    ports.dedup();
    ports
}

#[test]
fn a_whole_run_on_one_host_sends_no_packet_out_of_it() {
    let (Some(host), Some(outside)) = (Host::new(), Host::new()) else { return };
    host.connect(&outside);
    host.ip("route add default via 10.77.0.2");
    let before = host.packets_sent();
    let folder = Folder::new();
    {
        // As it is without any word about the range: LOCALHOST is the default.
        let _machine = machine(&host, "", &folder);
        let args = ["run", CONTOUR, "--control", "sinumerik_840c"];
        run(&mut host.kerf("", &args)).expect(0).says(&["done"]);
        assert!(open_ports(&host).len() > 4, "the nodes have ports");
        let groups = host.proc_net("igmp");
        // 239.255.0.1, where DDS is announced, as this file writes it.
        let joined = groups.split(PORT).nth(1).is_some_and(|of_port| of_port.contains("0100FFEF"));
        assert!(!joined, "the nodes listen outside: {groups}");
    }
    assert_eq!(host.packets_sent(), before, "packets have left the host");
}

#[test]
fn with_subnet_the_same_counter_sees_the_nodes() {
    let (Some(host), Some(outside)) = (Host::new(), Host::new()) else { return };
    host.connect(&outside);
    host.ip("route add default via 10.77.0.2");
    let before = host.packets_sent();
    let log = Folder::new();
    let node = host.kerf(SUBNET, &["node", "program_loader"]);
    let _node = Process::start(node, &log.path().join("loader.log"));
    until("announcements", || (host.packets_sent() > before).then_some(()));
    until("a group", || host.proc_net("igmp").contains("0100FFEF").then_some(()));
}

#[test]
fn an_idle_machine_is_quiet() {
    let Some(host) = Host::new() else { return };
    let folder = Folder::new();
    let _machine = machine(&host, "", &folder);
    // What its nodes have to find out of each other is over.
    std::thread::sleep(Duration::from_secs(3));
    let sent = || {
        let counters = host.proc_net("snmp");
        let udp = counters.lines().filter_map(|line| line.strip_prefix("Udp: ")).nth(1);
        let out = udp.and_then(|values| values.split(' ').nth(3));
        out.and_then(|count| count.parse::<u64>().ok()).expect("OutDatagrams")
    };
    let (before, began) = (sent(), std::time::Instant::now());
    std::thread::sleep(Duration::from_secs(5));
    let a_second = (sent() - before) as f64 / began.elapsed().as_secs_f64();
    // It was some 900 while discovery never came to rest.
    assert!(a_second < 300.0, "{a_second:.0} packets a second");
}

/// Sends a packet to each port, on request.
#[test]
fn knock_if_told_to() {
    let Ok(ports) = std::env::var(KNOCKS) else { return };
    let socket = UdpSocket::bind("0.0.0.0:0").expect("a socket");
    for port in ports.split(' ').map(|port| port.parse::<u16>().expect("a port")) {
        socket.send_to(b"RTPS\x02\x01\x01\x12", ("10.77.0.1", port)).expect("a packet");
    }
}

/// How many sockets of a node with these variables there are, and how many of them the kernel drops packets for that a
/// peer on the other host sends.
fn dropped_from_outside(range: &str, variables: &[(&str, &str)]) -> Option<(usize, usize)> {
    let (host, outside) = (Host::new()?, Host::new()?);
    host.connect(&outside);
    let folder = Folder::new();
    let mut node = host.kerf(range, &["node", "program_loader"]);
    node.envs(variables.iter().copied());
    let _node = Process::start(node, &folder.path().join("loader.log"));
    let log = || std::fs::read_to_string(folder.path().join("loader.log")).expect("a log");
    until("the loader", || log().contains("started").then_some(()));
    let mut ports = open_ports(&host);
    // Others are of sockets that only send.
    ports.retain(|port| *port < EPHEMERAL);
    assert!(ports.len() > 2, "{ports:?}");
    let words: Vec<String> = ports.iter().map(u16::to_string).collect();
    let mut knock = Command::new(std::env::current_exe().expect("this program"));
    knock.args(["alone::knock_if_told_to", "--exact"]).env(KNOCKS, words.join(" "));
    assert!(outside.on(&knock).status().expect("it can be run").success());
    assert!(!log().contains("panicked"), "{}", log());
    // What was sent has arrived: there is one computer.
    let table = host.proc_net("udp");
    let dropped = |port: &u16| {
        let end = format!(":{port:04X}");
        table.lines().filter_map(|line| line.trim().split_once(' ')).any(|(_, line)| {
            let mut columns = line.split_whitespace();
            let is_of_port = columns.next().is_some_and(|local| local.ends_with(&end));
            is_of_port && columns.next_back().is_some_and(|drops| drops != "0")
        })
    };
    Some((ports.len(), ports.iter().filter(|port| dropped(port)).count()))
}

#[test]
fn the_kernel_drops_what_comes_from_outside() {
    let Some((ports, dropped)) = dropped_from_outside("LOCALHOST", &[]) else { return };
    assert_eq!(dropped, ports, "a port is heard from outside");
    // Each of them is heard with these.
    assert_eq!(dropped_from_outside(SUBNET, &[]).map(|it| it.1), Some(0));
    let peer = |address| [("ROS_STATIC_PEERS", address)];
    assert_eq!(dropped_from_outside("", &peer("10.77.0.2")).map(|it| it.1), Some(0));
    // And by no other host than the one that is named.
    assert_eq!(dropped_from_outside("", &peer("10.77.0.3")), Some((ports, ports)));
}
