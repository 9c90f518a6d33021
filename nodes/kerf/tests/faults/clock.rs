//! The wall clock of every node jumps in a run.

use super::cell::{Cell, Plan, Serpentine, settings};
use cnc_msgs::wire::cnc_msgs::action::RunProgramResult;
use std::os::unix::fs::FileExt;
use std::path::Path;
use std::process::Command;
use std::time::{SystemTime, UNIX_EPOCH};

/// Adds the seconds of a file to the wall clock of the process started with it.
const SHIM: &str = r#"
#define _GNU_SOURCE
#include <fcntl.h>
#include <stdint.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

static const volatile int64_t *jump;

__attribute__((constructor)) static void begin(void) {
    const char *name = getenv("CLOCK_JUMP");
    int file = name ? open(name, O_RDONLY | O_CLOEXEC) : -1;
    if (file < 0) return;
    void *page = mmap(NULL, sizeof *jump, PROT_READ, MAP_SHARED, file, 0);
    if (page != MAP_FAILED) jump = page;
    close(file);
}

int clock_gettime(clockid_t clock, struct timespec *now) {
    int failed = (int)syscall(SYS_clock_gettime, clock, now);
    int is_wall = clock == CLOCK_REALTIME || clock == CLOCK_REALTIME_COARSE || clock == CLOCK_TAI;
    if (!failed && is_wall && jump) now->tv_sec += *jump;
    return failed;
}

int gettimeofday(struct timeval *now, void *zone) {
    (void)zone;
    struct timespec precise;
    if (clock_gettime(CLOCK_REALTIME, &precise)) return -1;
    now->tv_sec = precise.tv_sec;
    now->tv_usec = precise.tv_nsec / 1000;
    return 0;
}

time_t time(time_t *to) {
    struct timespec now;
    clock_gettime(CLOCK_REALTIME, &now);
    if (to) *to = now.tv_sec;
    return now.tv_sec;
}
"#;

const HOUR: i64 = 3_600;
/// How far a stamp may be from when its message is looked at, s.
const LATE: i64 = 120;

/// Makes the library in this folder.
fn shim(folder: &Path) -> std::path::PathBuf {
    let (source, library) = (folder.join("jump.c"), folder.join("jump.so"));
    std::fs::write(&source, SHIM).expect("written");
    let made = Command::new("cc")
        .args(["-shared", "-fPIC", "-O1", "-o"])
        .args([&library, &source])
        .status()
        .expect("a C compiler");
    assert!(made.success(), "the clock is not compiled");
    library
}

/// Seconds since 1970.
fn wall_clock() -> i64 {
    let now = SystemTime::now().duration_since(UNIX_EPOCH).expect("after 1970");
    i64::try_from(now.as_secs()).expect("not so soon")
}

#[test]
fn a_run_continues_when_the_wall_clock_jumps_by_hours() {
    let jump = settings(&"\0".repeat(8));
    let set = |seconds: i64| {
        jump.as_file().write_all_at(&seconds.to_ne_bytes(), 0).expect("written");
    };
    let surround = |mut command: Command, folder: &Path| {
        command.env("LD_PRELOAD", shim(folder)).env("CLOCK_JUMP", jump.path());
        command
    };
    let program = Serpentine { passes: 10, ..Serpentine::SHORT_LINES };
    let cell = Cell::new(&Plan { program, surround: &surround, ..Plan::default() });
    let run = cell.run_into_the_midst();
    let moment = cell.moment();
    for ahead in [6 * HOUR, -6 * HOUR, 0] {
        set(ahead);
        let line = cell.commander.state().line;
        // It is stamped with the new time, which does not change the age of a report.
        let state = cell.until_after(cell.moment(), "a stamp of the new time", |state| {
            let stamp = i64::from(state.header.stamp.sec);
            (stamp - wall_clock() - ahead).abs() < LATE
        });
        assert!((0.0..LATE as f64).contains(&state.link_age), "{state:?}");
        // 80 lines a second.
        cell.commander.until("the run to continue", |state| state.line > line + 80);
    }
    let result = cell.result(run);
    assert_eq!(result.outcome, RunProgramResult::OUTCOME_SUCCEEDED, "{result:?}");
    assert_eq!(cell.place(), [-100.0, -90.0], "the end of the program");
    let modes = cell.modes_since(moment);
    assert_eq!(modes.first(), Some(&"RUN"));
    assert!(modes.iter().all(|mode| ["RUN", "IDLE"].contains(mode)), "{modes:?}");
    let ages = cell.commander.states_since(moment.states).into_iter().map(|it| it.link_age);
    assert!(ages.into_iter().all(|age| (0.0..LATE as f64).contains(&age)));
    let sent = cell.sent_since(moment);
    assert!(!sent.contains(['!', '~']) && !sent.contains("\\x18"), "{sent}");
    // Its record is whole, and is reproduced.
    let bag = cell.machine.until_bags(1).remove(0);
    let bag = bag.to_str().expect("UTF-8");
    cell.machine.kerf(&["bag", "info", bag]).expect(0).says(&["complete:    yes"]);
    cell.machine.kerf(&["replay", bag]).expect(0).says(&["driver: 0 differences"]);
}
