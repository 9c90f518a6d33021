//! Actions between two nodes on the loopback interface.

mod common;

use common::{Fibonacci, Order, PATIENCE, Partial, Sequence, domain, soon, start};
use runtime::action::{CancelAnswer, GoalError, GoalOutcome};
use runtime::{Handle, Qos};
use std::time::Duration;

/// Serves Fibonacci: an order over 1000 is rejected, one below 0 runs until it
/// is canceled, -13 is given up; a second goal while one runs is rejected.
fn serve(handle: &Handle) {
    let mut server = handle.action_server::<Fibonacci>("fibonacci").expect("a server");
    let busy = std::sync::Arc::new(tokio::sync::Semaphore::new(1));
    let spawner = handle.clone();
    handle.spawn("fibonacci", async move {
        while let Some(offer) = server.next_goal().await {
            if offer.goal().order > 1000 {
                offer.reject("an order over 1000 takes for ever");
                continue;
            }
            let Ok(turn) = busy.clone().try_acquire_owned() else {
                offer.reject("another goal is running");
                continue;
            };
            let Some(goal) = offer.accept() else { continue };
            spawner.spawn("goal", async move {
                let mut sequence = vec![0, 1];
                match goal.goal().order {
                    -13 => drop((turn, goal)),
                    order if order < 0 => {
                        goal.cancel_requested().await;
                        // Whoever has the result may send the next goal.
                        drop(turn);
                        goal.end(GoalOutcome::Canceled, Sequence { sequence });
                    }
                    order => {
                        while sequence.len() <= order as usize {
                            let next = sequence[sequence.len() - 1] + sequence[sequence.len() - 2];
                            sequence.push(next);
                            goal.feedback(Partial { sequence: sequence.clone() });
                        }
                        drop(turn);
                        goal.end(GoalOutcome::Succeeded, Sequence { sequence });
                    }
                }
            });
        }
    });
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_goal_publishes_progress_and_its_result_is_available_late() {
    let (server, asker) = (start("server", domain(20)), start("asker", domain(20)));
    serve(server.handle());
    let client = asker.handle().action_client::<Fibonacci>("fibonacci").expect("client");
    assert!(soon("a server", client.wait_for_server(PATIENCE)).await);
    let mut goal = client.send_goal(Order { order: 5 }).await.expect("accepted");
    for length in 3..=6 {
        let feedback = soon("feedback", goal.feedback()).await.expect("the node runs");
        assert_eq!(feedback.sequence.len(), length);
    }
    let expected = Sequence { sequence: vec![0, 1, 1, 2, 3, 5] };
    for _ in 0..2 {
        let ended = goal.result(PATIENCE).await.expect("a result");
        assert_eq!(ended, (GoalOutcome::Succeeded, expected.clone()));
        tokio::time::sleep(Duration::from_millis(300)).await;
    }
    assert_eq!(goal.cancel().await, Ok(CancelAnswer::AlreadyEnded));
    drop((goal, client));
    server.stop().await;
    asker.stop().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_goal_can_be_canceled_and_a_second_one_is_rejected_meanwhile() {
    let (server, asker) = (start("server", domain(21)), start("asker", domain(21)));
    serve(server.handle());
    let client = asker.handle().action_client::<Fibonacci>("fibonacci").expect("client");
    assert!(soon("a server", client.wait_for_server(PATIENCE)).await);

    let endless = client.send_goal(Order { order: -1 }).await.expect("accepted");
    for order in [3, 2000] {
        let refused = client.send_goal(Order { order }).await.expect_err("busy");
        assert!(matches!(refused, GoalError::Rejected { .. }), "{refused}");
    }
    // Several ask for the result while it is not there.
    let waiting: Vec<_> = (0..3).map(|_| tokio::spawn(endless.result(PATIENCE))).collect();
    assert_eq!(endless.cancel().await, Ok(CancelAnswer::Canceling(1)));
    for result in waiting {
        let (outcome, _) = soon("a result", result).await.expect("no panic").expect("a result");
        assert_eq!(outcome, GoalOutcome::Canceled);
    }

    let endless = client.send_goal(Order { order: -1 }).await.expect("accepted");
    assert_eq!(client.cancel_all().await, Ok(CancelAnswer::Canceling(1)));
    assert_eq!(endless.result(PATIENCE).await.expect("a result").0, GoalOutcome::Canceled);
    assert_eq!(client.cancel_all().await, Ok(CancelAnswer::Canceling(0)));
    drop((endless, client));
    server.stop().await;
    asker.stop().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_goal_that_its_node_gives_up_is_aborted() {
    let (server, asker) = (start("server", domain(22)), start("asker", domain(22)));
    serve(server.handle());
    let client = asker.handle().action_client::<Fibonacci>("fibonacci").expect("client");
    assert!(soon("a server", client.wait_for_server(PATIENCE)).await);
    let goal = client.send_goal(Order { order: -13 }).await.expect("accepted");
    let ended = goal.result(PATIENCE).await.expect("a result");
    assert_eq!(ended, (GoalOutcome::Aborted, Sequence::default()));
    drop((goal, client));
    server.stop().await;
    asker.stop().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_client_that_dies_leaves_its_goal_running_and_others_can_cancel_it() {
    use cnc_msgs::wire::action_msgs::msg::{GoalStatus, GoalStatusArray};
    let server = start("server", domain(23));
    serve(server.handle());
    let first = start("first", domain(23));
    let client = first.handle().action_client::<Fibonacci>("fibonacci").expect("client");
    assert!(soon("a server", client.wait_for_server(PATIENCE)).await);
    let goal = client.send_goal(Order { order: -1 }).await.expect("accepted");
    let asking = tokio::spawn(goal.result(PATIENCE));
    tokio::time::sleep(Duration::from_millis(100)).await;
    asking.abort();
    drop((goal, client));
    first.stop().await;

    // Who comes later sees the goal on the latched status topic.
    let second = start("second", domain(23));
    let qos = Qos::LATCHED.with_depth(10);
    let mut statuses = second
        .handle()
        .subscription::<GoalStatusArray>("fibonacci/_action/status", qos)
        .expect("statuses");
    loop {
        let (array, _) = soon("a status", statuses.next()).await;
        if array.status_list.last().map(|goal| goal.status) == Some(GoalStatus::STATUS_EXECUTING) {
            break;
        }
    }
    let client = second.handle().action_client::<Fibonacci>("fibonacci").expect("client");
    assert!(soon("a server", client.wait_for_server(PATIENCE)).await);
    assert_eq!(client.cancel_all().await, Ok(CancelAnswer::Canceling(1)));
    loop {
        let (array, _) = soon("a status", statuses.next()).await;
        if array.status_list.last().map(|goal| goal.status) == Some(GoalStatus::STATUS_CANCELED) {
            break;
        }
    }
    let goal = client.send_goal(Order { order: 1 }).await.expect("the server is free again");
    assert_eq!(goal.result(PATIENCE).await.expect("a result").0, GoalOutcome::Succeeded);
    drop((goal, client, statuses));
    server.stop().await;
    second.stop().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_goal_that_is_canceled_while_the_node_decides_does_not_begin() {
    let server = start("server", domain(24));
    let mut goals = server.handle().action_server::<Fibonacci>("fibonacci").expect("a server");
    let asker = start("asker", domain(24));
    let client = asker.handle().action_client::<Fibonacci>("fibonacci").expect("client");
    assert!(soon("a server", client.wait_for_server(PATIENCE)).await);
    let asked = client.send_goal(Order { order: 1 });
    let decided = async {
        let offer = soon("an offer", goals.next_goal()).await.expect("the node lives");
        assert!(!offer.is_canceled());
        assert_eq!(client.cancel_all().await, Ok(CancelAnswer::Canceling(1)));
        assert!(offer.is_canceled());
        offer.accept()
    };
    let (answer, accepted) = tokio::join!(asked, decided);
    assert!(accepted.is_none(), "it would begin");
    assert!(matches!(answer, Err(GoalError::Rejected { .. })), "{answer:?}");
    drop((answer, client));
    server.stop().await;
    asker.stop().await;
}
