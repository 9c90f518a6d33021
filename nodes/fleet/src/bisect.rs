//! Which commit first makes something else of a bag: builds of history, one worktree and one build folder.
//!
//! A commit is compared with what the good one makes of the bag, not with the recording: a bag that
//! differs from its recording at the good commit, too, can be bisected.

use crate::FleetError;
use crate::core::bisection::{Bisection, Outcome};
use serde_json::Value;
use std::fs::{File, TryLockError};
use std::path::{Path, PathBuf};
use std::process::Command;

/// What is searched, and how a commit is built.
#[derive(Debug)]
pub struct Order {
    pub bag: PathBuf,
    pub good: String,
    pub bad: String,
    /// A folder of the repository.
    pub repository: PathBuf,
    /// The worktree and its build folder; kept for the next search.
    pub work: PathBuf,
    /// What builds a commit, run by a shell in its worktree.
    pub build: String,
    /// The program that this makes, from the worktree.
    pub program: PathBuf,
}

/// The commit that was found.
#[derive(Debug, PartialEq, Eq)]
pub struct Found {
    pub commit: String,
    pub subject: String,
    /// Commits before it that do not build or cannot read the bag: it may be one of them.
    pub suspects: Vec<String>,
    /// Commits that were built.
    pub built: usize,
}

/// Searches the first commit that differs. `say` gets a sentence for each commit that is tried.
pub fn run(order: &Order, say: &dyn Fn(&str)) -> Result<Found, FleetError> {
    let bag = order.bag.canonicalize().map_err(|why| FleetError::file(&order.bag, why))?;
    let (work, _lock) = taken(&order.work)?;
    let commit = |name: &str| {
        git(&order.repository, &["rev-parse", "--verify", "--quiet", &format!("{name}^{{commit}}")])
            .map_err(|_| {
                FleetError::Usage(format!("{name} is no commit of {}", order.repository.display()))
            })
    };
    let (good, bad) = (commit(&order.good)?, commit(&order.bad)?);
    let range = format!("{good}..{bad}");
    let listed = git(
        &order.repository,
        &["rev-list", "--reverse", "--topo-order", "--ancestry-path", &range],
    )?;
    let mut commits = vec![good];
    commits.extend(listed.lines().map(str::to_owned));
    if commits.len() < 2 {
        return Err(FleetError::Usage(format!(
            "{} is not an ancestor of {}",
            order.good, order.bad
        )));
    }
    let mut built = 0;
    let mut made_of = |commit: &str| -> Result<Option<Value>, FleetError> {
        built += 1;
        let made = made(order, &work, commit, &bag)?;
        let said =
            made.as_ref().map_or("does not build, or cannot compare the bag".to_owned(), |made| {
                let is_reproduced = made["reproduced"].as_bool() == Some(true);
                if is_reproduced {
                    "reproduced".to_owned()
                } else {
                    "different from the recording".to_owned()
                }
            });
        say(&format!("{}: {said}", short(commit)));
        Ok(made)
    };
    let last = commits.len() - 1;
    let not_usable = |name: &str| {
        FleetError::NotDone(format!(
            "{name} does not build, or cannot compare the bag; choose another commit"
        ))
    };
    let wanted = made_of(&commits[0])?.ok_or_else(|| not_usable(&order.good))?;
    let at_bad = made_of(&commits[last])?.ok_or_else(|| not_usable(&order.bad))?;
    if at_bad == wanted {
        return Err(FleetError::NotDone(format!(
            "{} and {} make the same of {}",
            order.good,
            order.bad,
            bag.display()
        )));
    }
    let mut bisection = Bisection::new(last);
    while let Some(next) = bisection.next() {
        let outcome = match made_of(&commits[next])? {
            None => Outcome::Broken,
            Some(made) if made == wanted => Outcome::Same,
            Some(_) => Outcome::Different,
        };
        bisection.record(next, outcome);
    }
    let (found, suspects) = bisection.first_different();
    let commit = commits[found].clone();
    let subject = git(&order.repository, &["log", "-1", "--format=%s", &commit])?;
    let suspects = suspects.into_iter().map(|it| commits[it].clone()).collect();
    Ok(Found { commit, subject, suspects, built })
}

/// The folder of the worktree, for this search alone and whatever the folder of a command is.
fn taken(work: &Path) -> Result<(PathBuf, File), FleetError> {
    let failed = |why: std::io::Error| FleetError::file(work, why);
    std::fs::create_dir_all(work).map_err(failed)?;
    let work = work.canonicalize().map_err(failed)?;
    let lock = File::create(work.join("lock")).map_err(failed)?;
    match lock.try_lock() {
        Ok(()) => Ok((work, lock)),
        Err(TryLockError::WouldBlock) => Err(FleetError::file(
            &work,
            "another search uses this folder; wait for it, or give another folder with --work",
        )),
        Err(TryLockError::Error(why)) => Err(failed(why)),
    }
}

/// What a commit makes of the bag, without the name of the bag; `None` if that cannot be said.
fn made(order: &Order, work: &Path, commit: &str, bag: &Path) -> Result<Option<Value>, FleetError> {
    let tree = work.join("tree");
    if tree.join(".git").exists() {
        git(&tree, &["checkout", "--quiet", "--force", "--detach", commit])?;
    } else {
        let folder = tree.display().to_string();
        git(&order.repository, &["worktree", "prune"])?;
        git(
            &order.repository,
            &["worktree", "add", "--quiet", "--force", "--detach", &folder, commit],
        )?;
    }
    let target = work.join("target");
    let mut build = Command::new("sh");
    build.args(["-c", &order.build]).current_dir(&tree).env("CARGO_TARGET_DIR", &target);
    let built = build.output().map_err(|why| FleetError::file(&tree, why))?;
    if !built.status.success() {
        return Ok(None);
    }
    let program = [target.join(&order.program), tree.join(&order.program)];
    let Some(program) = program.into_iter().find(|it| it.is_file()) else { return Ok(None) };
    let ran = Command::new(&program).args(["replay", "--json"]).arg(bag).output();
    let ran = ran.map_err(|why| FleetError::file(&program, why))?;
    // 0 reproduced, 1 different; anything else is no verdict.
    if !matches!(ran.status.code(), Some(0 | 1)) {
        return Ok(None);
    }
    Ok(serde_json::from_slice(&ran.stdout).ok())
}

fn git(folder: &Path, words: &[&str]) -> Result<String, FleetError> {
    let ran = Command::new("git").arg("-C").arg(folder).args(words).output();
    let ran = ran.map_err(|why| FleetError::NotDone(format!("git: {why}")))?;
    if ran.status.success() {
        return Ok(String::from_utf8_lossy(&ran.stdout).trim().to_owned());
    }
    let why = String::from_utf8_lossy(&ran.stderr).trim().to_owned();
    Err(FleetError::NotDone(format!("git {}: {why}", words.join(" "))))
}

fn short(commit: &str) -> &str {
    commit.get(..12).unwrap_or(commit)
}
