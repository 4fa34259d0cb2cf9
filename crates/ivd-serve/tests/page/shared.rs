//! One drives, others watch.

use std::sync::mpsc::channel;

use ivd_serve::Place;
use serde_json::{Value as Json, json};

use super::common::{Client, Heard, Server};

fn handles(heard: &Heard) -> &Vec<Json> {
    heard.head["figures"]["handles"].as_array().unwrap()
}

/// The pictures that a frame brings, each with its bytes.
fn pictures(heard: &Heard) -> Vec<(String, Vec<u8>)> {
    let mut at = 0;
    let each = heard.head["pictures"].as_array().unwrap().iter().map(|picture| {
        let length = picture["bytes"].as_u64().unwrap() as usize;
        at += length;
        (picture["pane"].as_str().unwrap().to_owned(), heard.bytes[at - length..at].to_vec())
    });
    let each = each.collect();
    assert_eq!(at, heard.bytes.len());
    each
}

fn grab(client: &mut Client) {
    client.send(&json!({ "do": "grab", "pane": "volume", "at": [0.5, 0.5] }));
    client.hear_of("frame", |heard| heard.head["figures"]["held"] == 0);
}

#[test]
fn who_drives_drags_and_who_watches_sees_it() {
    let server = Server::start(Place::Port(0));
    let (mut driver, mut watcher) = (server.join(&server.links.drive), server.join(&server.links.watch));
    assert_eq!(driver.hear_of("hello", |_| true).head["may_drive"], true);
    assert_eq!(watcher.hear_of("hello", |_| true).head["may_drive"], false);
    let first = watcher.hear_of("frame", |_| true);
    assert_eq!(pictures(&first).len(), 4);
    assert!(pictures(&first).iter().all(|(_, png)| png.starts_with(b"\x89PNG")));

    grab(&mut driver);
    for x in [0.51, 0.53] {
        driver.send(&json!({ "do": "drag", "to": [x, 0.48] }));
    }
    driver.send(&json!({ "do": "drop" }));
    let moved =
        |heard: &Heard| heard.head["figures"]["undo"] == "drag a new handle" && !handles(heard).is_empty();
    let dragged = driver.hear_of("frame", moved);
    let seen = watcher.hear_of("frame", moved);
    assert_eq!(handles(&seen), handles(&dragged));
    assert!(handles(&seen)[0]["by"].as_array().unwrap().iter().any(|c| c.as_f64().unwrap() != 0.0));

    watcher.send(&json!({ "do": "undo" }));
    assert!(watcher.hear_of("problem", |_| true).head["text"].as_str().unwrap().contains("lets watch"));
    watcher.send(&json!({ "do": "take" }));
    watcher.hear_of("problem", |_| true);
    driver.send(&json!({ "do": "save", "what": "scene" }));
    let file = driver.hear_of("file", |_| true);
    assert_eq!(
        (&file.head["name"], file.head["bytes"].as_u64().unwrap()),
        (&json!("scene.toml"), file.bytes.len() as u64)
    );
    assert!(String::from_utf8(file.bytes).unwrap().contains("[[deform.handle]]"));
    // A frame brings only what has changed.
    driver.send(&json!({ "do": "slice", "pane": "axial", "steps": 2 }));
    let sliced = driver.hear_of("frame", |heard| pictures(heard).iter().any(|(pane, _)| pane == "axial"));
    assert!(pictures(&sliced).iter().all(|(pane, _)| pane != "coronal"), "{}", sliced.head["pictures"]);
}

#[test]
fn the_wheel_is_handed_over_and_a_lost_drag_is_abandoned() {
    let server = Server::start(Place::Port(0));
    let mut one = server.join(&server.links.drive);
    grab(&mut one);
    let mut two = server.join(&server.links.drive);
    two.send(&json!({ "do": "undo" }));
    assert!(two.hear_of("problem", |_| true).head["text"].as_str().unwrap().contains("somebody else"));
    // Who goes in the middle of a drag leaves nothing of it.
    one.send(&json!({ "do": "drag", "to": [0.53, 0.47] }));
    two.hear_of("frame", |heard| !handles(heard).is_empty());
    drop(one);
    two.hear_of("wheel", |heard| heard.head["free"] == true);
    two.hear_of("frame", |heard| handles(heard).is_empty() && heard.head["figures"]["undo"].is_null());
    two.send(&json!({ "do": "take" }));
    two.hear_of("wheel", |heard| heard.head["drives"] == true);
    let mut three = server.join(&server.links.drive);
    two.send(&json!({ "do": "hand_over" }));
    three.hear_of("wheel", |heard| heard.head["free"] == true);
    three.send(&json!({ "do": "orbit", "by": [0.1, 0.0] }));
    three.hear_of("wheel", |heard| heard.head["drives"] == true);
}

#[test]
fn what_is_opened_is_seen_and_turned_before_it_can_be_moved() {
    let (go, wait) = channel();
    let server = Server::start_after(Place::Port(0), wait);
    let mut driver = server.join(&server.links.drive);
    let has = |heard: &Heard, pane: &str| pictures(heard).iter().any(|(name, _)| name == pane);
    let volume = |heard: &Heard| has(heard, "volume");
    let first = driver.hear_of("scan", volume);
    assert_eq!(first.head["figures"]["size"], json!([512, 512]));
    driver.send(&json!({ "do": "resize", "size": [64, 48] }));
    driver.hear_of("scan", |heard| volume(heard) && heard.head["figures"]["size"] == json!([64, 48]));
    driver.send(&json!({ "do": "slice", "pane": "axial", "steps": 2 }));
    let sliced = driver.hear_of("scan", |heard| has(heard, "axial"));
    assert!(!has(&sliced, "coronal"), "{}", sliced.head["pictures"]);
    // What needs a lattice waits for one.
    driver.send(&json!({ "do": "grab", "pane": "volume", "at": [0.5, 0.5] }));
    go.send(()).unwrap();
    let frame = driver.hear_of("frame", |_| true);
    assert_eq!((pictures(&frame).len(), &frame.head["figures"]["size"]), (4, &json!([64, 48])));
    driver.hear_of("frame", |heard| heard.head["figures"]["held"] == 0);
}

#[test]
fn the_body_is_seen_at_rest_and_measured_by_whoever_looks() {
    let server = Server::start(Place::Port(0));
    let (mut driver, mut watcher) = (server.join(&server.links.drive), server.join(&server.links.watch));
    let first = pictures(&driver.hear_of("frame", |_| true));
    driver.send(&json!({ "do": "measure", "pane": "axial", "from": [0.25, 0.5], "to": [0.5, 0.5] }));
    driver.send(&json!({ "do": "add", "place": [12.0, 21.0, 12.0], "by": [0.0, -1.0, 0.0] }));
    driver.hear_of("frame", |heard| !handles(heard).is_empty());
    driver.send(&json!({ "do": "compare", "shows": "rest" }));
    let at_rest = |heard: &Heard| heard.head["figures"]["compare"] == json!({ "shows": "rest", "at": 0.5 });
    let seen = watcher.hear_of("frame", at_rest);
    let axial = |all: &[(String, Vec<u8>)]| all.iter().find(|(pane, _)| pane == "axial").cloned();
    // Of its four pictures a frame brings those that are new.
    assert!(axial(&first).is_some() && axial(&pictures(&seen)) == axial(&first), "as it was first");
    // A quarter of 24 mm.
    let ruler = &seen.head["figures"]["rulers"][0];
    assert!((ruler["rest_mm"][0].as_f64().unwrap() - 6.0).abs() < 1e-9, "{ruler}");
    watcher.send(&json!({ "do": "compare", "shows": "now" }));
    assert!(watcher.hear_of("problem", |_| true).head["text"].as_str().unwrap().contains("lets watch"));
}
