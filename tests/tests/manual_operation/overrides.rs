//! Overrides: asked for, shown, asked for again.

use super::*;

fn set(line: &mut Line, wanted: Overrides) -> f64 {
    let then = line.now;
    line.ask(Command::SetOverrides(wanted)).unwrap();
    let percents = line.state().overrides_percent;
    let named = [wanted.feed, wanted.rapid, wanted.spindle].into_iter().zip(percents);
    for (wanted, is) in named {
        assert!(wanted.is_none_or(|wanted| wanted == is), "{percents:?} at the success");
    }
    (line.now - then).as_secs_f64()
}

#[test]
fn an_override_is_called_done_when_a_report_shows_it_and_takes_no_second() {
    for firmware in virtual_controller::Firmware::ALL {
        let settings = Settings::small_router_of(firmware);
        let start_in_machine = Some([-300.0, -200.0, -50.0]);
        let mut line = Line::connected(Build { start_in_machine, ..Build::new(settings) });
        line.start(kerf_tests::line::straight(290, 1.0), 0);
        line.until("it cuts", |line| line.state().line >= 3);
        let feed = |percent| Overrides { feed: Some(percent), ..Overrides::default() };
        for wanted in [
            feed(190),
            Overrides { feed: Some(57), rapid: Some(25), spindle: Some(133) },
            feed(10),
            feed(200),
            Overrides { feed: Some(11), rapid: Some(100), spindle: Some(199) },
            Overrides { feed: Some(100), rapid: Some(50), spindle: Some(10) },
        ] {
            let seconds = set(&mut line, wanted);
            assert!(seconds < 1.0, "{firmware}: {wanted:?} took {seconds} s");
        }
        assert!(line.finished.is_none(), "{firmware}: in the run");
    }
}

#[test]
fn every_feed_override_is_reached_from_idle_within_a_second() {
    let mut line = Line::connected(build());
    line.forget_written();
    for percent in (10..=200).chain((10..=200).rev().step_by(7)).chain([200, 10, 199, 11]) {
        let wanted = Overrides { feed: Some(percent), spindle: Some(210 - percent), rapid: None };
        let seconds = set(&mut line, wanted);
        assert!(seconds < 1.0, "{percent} took {seconds} s");
    }
}

#[test]
fn overrides_are_asked_for_again_when_a_byte_is_lost() {
    for lost in 30..60 {
        let fault = format!("rx-drop@byte={lost}");
        let mut line = Line::new(DriverConfig::default(), build(), &[&fault]);
        line.until("idle", |line| line.mode() == Mode::Idle);
        let wanted = Overrides { feed: Some(83), rapid: Some(25), spindle: Some(121) };
        set(&mut line, wanted);
        set(&mut line, Overrides { feed: Some(100), ..wanted });
    }
}

#[test]
fn an_override_that_does_not_show_is_refused_with_the_numbers() {
    let mut line = homing();
    let wanted = Overrides { feed: Some(57), rapid: Some(25), spindle: None };
    let refusal = line.ask(Command::SetOverrides(wanted)).expect_err("a refusal");
    assert_eq!(line.mode(), Mode::Home);
    assert_eq!(refusal.error_code, error_code::NO_ANSWER);
    for text in ["feed 57 %, rapid 25 %", "feed 100 %, rapid 100 %, spindle 100 % after 3 s"] {
        assert!(refusal.message.contains(text), "{}", refusal.message);
    }
}

#[test]
fn overrides_in_a_row_end_at_the_last_and_never_go_beyond_it() {
    let mut line = Line::connected(build());
    line.start(kerf_tests::line::straight(290, 1.0), 0);
    line.until("it cuts", |line| line.state().line >= 3);
    let feed = |percent| Overrides { feed: Some(percent), ..Overrides::default() };
    let ids =
        [150, 150, 150, 50, 120].map(|percent| line.begin(Command::SetOverrides(feed(percent))));
    let rapid = Overrides { rapid: Some(50), ..Overrides::default() };
    let then = line.now;
    line.ask(Command::SetOverrides(rapid)).unwrap();
    assert_eq!(line.state().overrides_percent, [120, 50, 100]);
    assert!((line.now - then).as_secs_f64() < 1.0, "it took {:?}", line.now - then);
    // Those that a later one replaced are answered too.
    let answers = ids.map(|id| {
        let (_, result) = line.replies.iter().find(|(of, _)| *of == id).expect("an answer");
        result.as_ref().map_err(|refusal| refusal.error_code).is_ok()
    });
    assert_eq!(answers, [false, false, false, false, true]);
    // A reset sets them back, and nothing sets them again.
    let id = line.begin(Command::SetOverrides(feed(200)));
    line.ask(Command::SoftReset).unwrap();
    let (_, result) = line.replies.iter().find(|(of, _)| *of == id).expect("an answer");
    assert!(result.is_err(), "{result:?}");
    let then = line.now;
    line.wait(6.0);
    assert_eq!(line.state().overrides_percent, [100; 3]);
    assert!(!line.said_since(then).contains('\u{91}'));
}

#[test]
fn overrides_that_are_asked_for_again_and_again_time_out_all_the_same() {
    let mut line = homing();
    let wanted = Overrides { feed: Some(50), ..Overrides::default() };
    let first = line.begin(Command::SetOverrides(wanted));
    for _ in 0..7 {
        line.wait(0.5);
        line.begin(Command::SetOverrides(wanted));
    }
    assert_eq!(line.mode(), Mode::Home);
    let answer = line.replies.iter().find(|(id, _)| *id == first);
    let answer = answer.expect("it is answered after three seconds").1.clone();
    assert_eq!(answer.unwrap_err().error_code, error_code::NO_ANSWER);
}

#[test]
fn requests_for_overrides_do_not_pile_up() {
    let mut line = homing();
    let wanted = Overrides { feed: Some(50), ..Overrides::default() };
    for _ in 0..1_000 {
        line.begin(Command::SetOverrides(wanted));
    }
    let refused = line.replies.iter().filter_map(|(_, result)| result.as_ref().err());
    let busy = refused.filter(|refusal| refusal.error_code == error_code::BUSY).count();
    assert!(busy > 900, "{busy} were refused");
}
