//! Peers that name files to the loader: pipes, endless ones, and those of others.
//!
//! The loader is alone; its clients are nodes of this process.

use super::machine::{domain, until};
use super::stranger::Stranger;
use super::support::{Folder, TIMEOUT, kerf};
use cnc_msgs::wire::cnc_msgs::srv::{
    LoadProgram, LoadProgramRequest as Request, LoadProgramResponse as Response, ReadBlock,
    ReadBlockRequest,
};
use runtime::Client;
use std::process::{Child, Command, Stdio};

/// The loader; gone with this value.
struct Loader(Child);

impl Drop for Loader {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

struct Shop {
    folder: Folder,
    domain: String,
    namespace: String,
    _loader: Loader,
}

impl Shop {
    /// A loader that reads from `parts` and `controls`.
    fn open() -> Self {
        let (folder, domain) = (Folder::new(), domain());
        for name in ["parts", "controls"] {
            std::fs::create_dir(folder.path().join(name)).expect("made");
        }
        let namespace = format!("/files_{}_{domain}", std::process::id());
        let log = std::fs::File::create(folder.path().join("loader.log")).expect("a log");
        let loader = kerf()
            .env("ROS_DOMAIN_ID", &domain)
            .current_dir(folder.path())
            .args(["node", "program_loader", "--ros-args", "-r", &format!("__ns:={namespace}")])
            .args(["-p", "program_directories:=[parts]", "-p", "control_directories:=[controls]"])
            .stdout(Stdio::null())
            .stderr(log)
            .spawn()
            .expect("a loader");
        Self { folder, domain, namespace, _loader: Loader(loader) }
    }

    fn stranger(&self, name: &str) -> Stranger {
        Stranger::join_as(name, &self.domain, &self.namespace)
    }

    fn log(&self) -> String {
        std::fs::read_to_string(self.folder.path().join("loader.log")).expect("a log")
    }
}

async fn load(client: &Client<LoadProgram>, request: Request) -> Response {
    client.call_within(request, TIMEOUT).await.expect("the loader answers")
}

#[test]
fn a_pipe_and_an_endless_file_cost_other_clients_nothing() {
    let shop = Shop::open();
    let parts = shop.folder.path().join("parts");
    assert!(Command::new("mkfifo").arg(parts.join("pipe")).status().expect("mkfifo").success());
    std::os::unix::fs::symlink("/dev/zero", parts.join("endless")).expect("a link");
    std::fs::File::create(parts.join("large")).and_then(|it| it.set_len(2 << 30)).expect("a hole");
    std::fs::write(parts.join("part.ngc"), "G21 G90\nG0 X1\nM30\n").expect("written");
    let strangers = [shop.stranger("one"), shop.stranger("two")];
    until("the loader", || shop.log().contains("started").then_some(()));
    let clients = [0, 1].map(|index: usize| {
        strangers[index]
            .inside(|node| node.client::<LoadProgram>("load_program").expect("a client"))
    });
    let by_path = |path: &str| Request { path: path.into(), ..Request::default() };
    let text = || Request { text: "G0 X1\nM30\n".into(), ..Request::default() };
    for (path, code, says) in [
        ("pipe", Response::FILE_UNREADABLE, "named pipe (FIFO)"),
        ("large", Response::TOO_LARGE, "2147483648 bytes"),
        ("endless", Response::FILE_UNREADABLE, "program_directories"),
        ("/dev/zero", Response::FILE_UNREADABLE, "program_directories"),
    ] {
        // The pipe has no writer: an answer shows that the loader does not wait for it.
        let (bad, good) = strangers[0].wait(async {
            tokio::join!(load(&clients[0], by_path(path)), load(&clients[1], text()))
        });
        assert_eq!(bad.error_code, code, "{}", bad.message);
        assert!(bad.message.contains(says), "{}", bad.message);
        assert!(good.success, "{}", good.message);
    }
    let absolute = parts.join("part.ngc").display().to_string();
    for path in ["part.ngc", &absolute] {
        let answer = strangers[0].wait(load(&clients[0], by_path(path)));
        assert!(answer.success, "{}", answer.message);
    }
}

#[test]
fn no_file_of_others_is_quoted_in_an_answer_or_the_log() {
    let shop = Shop::open();
    let word = "hunter2";
    let text = format!("{word}:x:0:0\n{word}: [\n");
    shop.folder.file("secret.yaml", &text);
    shop.folder.file("controls/notes.yaml", &text);
    let stranger = shop.stranger("one");
    until("the loader", || shop.log().contains("started").then_some(()));
    let loads = stranger.inside(|node| node.client::<LoadProgram>("load_program").expect("one"));
    let reads = stranger.inside(|node| node.client::<ReadBlock>("read_block").expect("one"));
    let outside = shop.folder.path().join("secret.yaml").display().to_string();
    for (name, says) in [
        ("/etc/passwd", "control_directories"),
        (outside.as_str(), "control_directories"),
        ("../secret.yaml", "control_directories"),
        ("notes.yaml", "notes.yaml:"),
    ] {
        let control = name.to_owned();
        let request = Request { text: "G0 X1\n".into(), control, ..Request::default() };
        let answer = stranger.wait(load(&loads, request));
        assert_eq!(answer.error_code, Response::UNKNOWN_CONTROL, "{}", answer.message);
        let control = name.to_owned();
        let request = ReadBlockRequest { text: "G0 X1".into(), control, ..Default::default() };
        let block = stranger.wait(reads.call_within(request, TIMEOUT)).expect("an answer");
        for message in [answer.message, block.message] {
            assert!(message.contains(says), "{message}");
            assert!(!message.contains(word) && !message.contains("root:"), "{message}");
        }
    }
    for path in ["/etc/passwd", outside.as_str(), "../secret.yaml"] {
        let request = Request { path: path.into(), ..Request::default() };
        let answer = stranger.wait(load(&loads, request));
        assert_eq!(answer.error_code, Response::FILE_UNREADABLE, "{}", answer.message);
        assert!(answer.message.contains("program_directories"), "{}", answer.message);
    }
    // A name that steers a terminal, too.
    let name = "\u{1b}[2J\n[ERROR] forged".to_owned();
    let request = Request { text: "G0 X1\nM30\n".into(), name, ..Request::default() };
    assert!(stranger.wait(load(&loads, request)).message.starts_with("\\u001b[2J\\n[ERROR]"));
    until("the log line", || shop.log().contains("forged").then_some(()));
    let log = shop.log();
    assert!(!log.contains(word) && !log.contains('\u{1b}'), "{log}");
    assert!(!log.lines().any(|line| line.starts_with("[ERROR] forged")), "{log}");
}
