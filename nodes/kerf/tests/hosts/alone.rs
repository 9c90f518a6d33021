//! A machine that is to stay on its host: nothing leaves, nothing comes in.

use super::network::{Host, PORT, Process, until};
use super::support::{CONTOUR, Folder, TOOLS, run};
use std::io::ErrorKind;
use std::net::UdpSocket;
use std::process::Command;
use std::time::Duration;

/// Says to a process of this test program which ports it is to knock at.
const KNOCKS: &str = "KERF_TEST_KNOCKS";

/// The whole machine on a host, idle.
fn machine(host: &Host, range: &str, folder: &Folder) -> Process {
    let table = format!("compensation_planner:tool_table:={TOOLS}");
    let mut up = host.kerf(range, &["up", "--virtual-controller", "--time-factor", "50"]);
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
    let node = host.kerf("SUBNET", &["node", "program_loader"]);
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

/// Sends a packet to each port and reports which are closed, on request.
#[test]
#[allow(clippy::print_stdout, reason = "what it found")]
fn knock_if_told_to() {
    let Ok(ports) = std::env::var(KNOCKS) else { return };
    for port in ports.split(' ').map(|port| port.parse::<u16>().expect("a port")) {
        let socket = UdpSocket::bind("0.0.0.0:0").expect("a socket");
        socket.set_read_timeout(Some(Duration::from_millis(300))).expect("a deadline");
        socket.connect(("10.77.0.1", port)).expect("an address");
        socket.send(b"RTPS\x02\x01\x01\x12").expect("a packet");
        // The host itself reports a closed port, or there is no answer.
        let is_closed = socket
            .recv(&mut [0; 1500])
            .is_err_and(|error| error.kind() == ErrorKind::ConnectionRefused);
        println!("port {port} is {}", if is_closed { "closed" } else { "open" });
    }
}

/// What a peer on the other host finds at the ports of a node with this range.
fn found_from_outside(range: &str) -> Option<String> {
    let (host, outside) = (Host::new()?, Host::new()?);
    host.connect(&outside);
    let folder = Folder::new();
    let node = host.kerf(range, &["node", "program_loader"]);
    let _node = Process::start(node, &folder.path().join("loader.log"));
    let log = || std::fs::read_to_string(folder.path().join("loader.log")).expect("a log");
    until("the loader", || log().contains("started").then_some(()));
    let ports = open_ports(&host);
    assert!(ports.len() > 2, "{ports:?}");
    let ports: Vec<String> = ports.iter().map(u16::to_string).collect();
    let mut knock = Command::new(std::env::current_exe().expect("this program"));
    knock.args(["alone::knock_if_told_to", "--exact", "--nocapture"]).env(KNOCKS, ports.join(" "));
    let found = outside.on(&knock).output().expect("it can be run");
    assert!(!log().contains("panicked"), "{}", log());
    Some(String::from_utf8_lossy(&found.stdout).into_owned())
}

#[test]
fn a_packet_from_outside_finds_every_port_of_a_node_closed() {
    let Some(found) = found_from_outside("LOCALHOST") else { return };
    assert!(found.contains("is closed") && !found.contains("is open"), "{found}");
    let Some(found) = found_from_outside("SUBNET") else { return };
    assert!(
        found.contains("is open"),
        "closed ports cannot be distinguished from open ones: {found}"
    );
}
