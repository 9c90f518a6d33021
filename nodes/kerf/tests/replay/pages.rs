//! The pages of bags, also of incomplete ones.

use crate::bag::{Form, TestBag, golden};
use crate::support::{Folder, Ran, kerf, run};
use cnc_msgs::wire::cnc_msgs::msg as wire;
use serde_json::Value;
use std::path::Path;

/// Makes the page of `kerf bag report`.
fn report(bag: &Path, page: &Path) -> Ran {
    run(kerf().args(["bag", "report"]).args([bag, page]))
}

/// What a page shows.
fn data(page: &Path) -> Value {
    let html = std::fs::read_to_string(page).expect("a page");
    let (_, after) = html.split_once("id=\"data\">").expect("the data");
    let (data, _) = after.split_once("</script>").expect("its end");
    serde_json::from_str(data).expect("JSON")
}

/// The report on a golden bag that was changed.
#[track_caller]
fn reported(change: impl FnOnce(&mut TestBag)) -> Value {
    let folder = Folder::new();
    let (path, page) = (folder.path().join("bag"), folder.path().join("page.html"));
    let mut bag = TestBag::golden("sinumerik_840c_contour");
    change(&mut bag);
    bag.write(&path, Form::OURS);
    report(&path, &page).expect(0);
    data(&page)
}

fn forget_plans(bag: &mut TestBag) {
    bag.forget::<wire::CompensatedPath>();
    bag.forget::<wire::PathChunk>();
    bag.forget::<wire::CompensationReport>();
}

#[test]
fn a_run_is_shown_without_its_plan_and_not_called_complete() {
    assert_eq!(reported(|_| {})["sheets"][0]["verdict"], "recording complete");
    let page = reported(forget_plans);
    let sheets = page["sheets"].as_array().expect("sheets");
    assert_eq!(sheets.len(), 1);
    assert_eq!(sheets[0]["verdict"], "recording not complete");
    assert_eq!(sheets[0]["summary"], "the bag holds no plan");
    assert!(page["runs"][0]["dialogue"].as_array().is_some_and(|rows| rows.len() > 20));

    let page = reported(|bag| bag.silence::<wire::PathChunk>());
    assert_eq!(page["sheets"][0]["verdict"], "recording not complete");
    let said = page["sheets"][0]["summary"].as_str().expect("a text");
    assert!(said.starts_with("a chunk of the path of revision"), "{said}");
}

#[test]
fn a_bag_with_nothing_to_show_is_an_error() {
    let folder = Folder::new();
    let (path, page) = (folder.path().join("bag"), folder.path().join("page.html"));
    let mut bag = TestBag::golden("sinumerik_840c_contour");
    forget_plans(&mut bag);
    bag.silence::<wire::ControllerTraffic>();
    bag.silence::<wire::MachineState>();
    bag.write(&path, Form::OURS);
    report(&path, &page).expect(2).says(&["there is nothing to show"]);
    assert!(!page.exists());
}

#[test]
fn a_run_in_stretches_is_shown_with_the_last_of_them() {
    let folder = Folder::new();
    let page = folder.path().join("page.html");
    report(&golden("rs274_stretches"), &page).expect(0);
    let page = data(&page);
    // That which has cut, and what is loaded for the next run.
    let [last, next] = &page["sheets"].as_array().expect("sheets")[..] else {
        panic!("{:?}", page["sheets"]);
    };
    let text = |sheet: &Value| sheet["program"].to_string();
    assert!(text(last).contains("results of probes, appended by Kerf: 3"), "{}", text(last));
    assert!(!text(next).contains("results of probes"), "{}", text(next));
    assert!(!last["run"].is_null() && next["run"].is_null());
}

#[test]
fn a_run_is_shown_once_and_with_the_plans_that_were_run() {
    let folder = Folder::new();
    let page = folder.path().join("page.html");
    report(&golden("refused_programs"), &page).expect(0);
    let page = data(&page);
    let sheets = page["sheets"].as_array().expect("sheets");
    let run: Vec<bool> = sheets.iter().map(|sheet| !sheet["run"].is_null()).collect();
    assert!(run.len() > 2 && run[0] && !run[1..].contains(&true), "{run:?}");
    assert_eq!(page["runs"].as_array().map(Vec::len), Some(1));

    // Two plans of one program, one after the other.
    let wear = folder.path().join("wear.html");
    report(&golden("sinumerik_840c_wear_correction"), &wear).expect(0);
    assert_eq!(data(&wear)["runs"].as_array().map(Vec::len), Some(1));

    // The cause of the stop is shown where it ran.
    let alarm = folder.path().join("alarm.html");
    report(&golden("alarm_hard_limit"), &alarm).expect(0);
    let pins = data(&alarm)["sheets"][0]["pins"].to_string();
    assert!(pins.contains("ALARM line"), "{pins}");
}

#[test]
fn a_run_of_a_plan_that_is_not_there_is_on_a_sheet_of_its_own() {
    let page = reported(|bag| {
        bag.change(|state: &mut wire::MachineState| {
            state.path_revision += u64::from(state.path_revision > 0) * 100;
            true
        });
    });
    let sheets = page["sheets"].as_array().expect("sheets");
    let titles: Vec<&str> = sheets.iter().filter_map(|sheet| sheet["title"].as_str()).collect();
    assert!(titles.len() == 2 && titles[1].ends_with("bag, the run"), "{titles:?}");
    assert!(sheets[0]["run"].is_null() && sheets[1]["run"] == 0);
}

#[test]
fn no_page_is_written_over_a_bag() {
    let folder = Folder::new();
    let file = crate::bag::files(&golden("nct_offsets")).remove(0);
    let bytes = std::fs::read(file).expect("a golden bag");
    let bag = folder.file("bag.mcap", &bytes);
    report(&bag, &bag)
        .expect(2)
        .says(&["bag.mcap is an input of this command and is not overwritten"]);
    crate::replay(&bag, &["--html", &bag.display().to_string()]).expect(2);
    assert!(std::fs::read(&bag).expect("it is still there") == bytes);
}
