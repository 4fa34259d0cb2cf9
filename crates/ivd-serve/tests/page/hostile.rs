//! Messages that mean harm.

use ivd_serve::Place;
use serde_json::{Value as Json, json};

use super::common::Server;

/// Memory of this process that is its own (bytes).
fn memory() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("RssAnon:"));
    line.and_then(|line| line.split_whitespace().next()?.parse::<u64>().ok()).unwrap_or(0) << 10
}

/// Numbers that look random.
struct Draw(u64);

impl Draw {
    fn below(&mut self, n: usize) -> usize {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 33) as usize) % n
    }

    fn number(&mut self) -> Json {
        let all = [
            json!(1e308),
            json!(-1e308),
            json!(0.0),
            json!(1e-300),
            json!(0.5),
            json!(1e6),
            json!(-3),
            json!("x"),
            Json::Null,
        ];
        all[self.below(all.len())].clone()
    }

    fn pair(&mut self) -> Json {
        json!([self.number(), self.number()])
    }

    fn triple(&mut self) -> Json {
        json!([self.number(), self.number(), self.number()])
    }

    /// A request by its form, with hostile values.
    fn formed(&mut self) -> Json {
        let pane = ["volume", "axial", "coronal", "sagittal"][self.below(4)];
        match self.below(27) {
            0 => json!({ "do": "resize", "size": [32_768, 32_768] }),
            1 => json!({ "do": "orbit", "by": self.pair() }),
            2 => json!({ "do": "zoom", "factor": self.number(), "at": self.pair() }),
            3 => json!({ "do": "grab", "pane": pane, "at": self.pair() }),
            4 => json!({ "do": "drag", "to": self.pair() }),
            5 => json!({ "do": "radius", "radius": self.number() }),
            6 => json!({ "do": "add", "place": self.triple(), "by": self.triple() }),
            7 => json!({ "do": "move", "handle": self.below(1_000_000), "by": self.triple() }),
            8 => json!({ "do": "remove", "handle": u32::MAX }),
            9 => json!({ "do": "pin", "pane": pane, "at": self.pair() }),
            10 => json!({ "do": "level", "level": self.below(300) }),
            11 => json!({ "do": "stiffness", "stiffness": self.number() }),
            12 => json!({ "do": "map", "map": "biharmonic" }),
            13 => json!({ "do": "wheel", "steps": i32::MAX }),
            14 => json!({ "do": "transfer", "by": self.pair() }),
            15 => {
                let (centre, normal) = (self.triple(), self.triple());
                json!({ "do": "incise", "centre": centre, "normal": normal, "radius": self.number(), "open": self.number() })
            }
            16 => json!({ "do": "close", "space": self.below(3) }),
            17 => json!({ "do": "clip", "point": self.triple(), "normal": self.triple() }),
            18 => json!({ "do": "unclip", "clip": self.below(3) }),
            19 => {
                let (pivot, axis, by) = (self.triple(), self.triple(), self.triple());
                json!({ "do": "turn", "bone": 0, "pivot": pivot, "axis": axis, "angle": self.number(), "by": by })
            }
            20 => json!({ "do": "stroke", "pane": pane, "from": self.pair(), "to": self.pair() }),
            21 => {
                json!({ "do": "open", "space": self.below(3), "radius": self.number(), "open": self.number() })
            }
            22 => json!({ "do": "clip_box", "min": self.triple(), "max": self.triple() }),
            23 => {
                let plane = json!({ "point": self.triple(), "normal": self.triple() });
                json!({ "do": "move_clip", "clip": self.below(3), "part": { "plane": plane } })
            }
            24 => json!({ "do": "material", "class": self.below(65_536), "stiffness": self.number() }),
            25 => {
                let solver = ["ring", "springs", "body"][self.below(3)];
                json!({ "do": "solver", "solver": solver })
            }
            _ => json!({ "do": "slice", "pane": pane, "steps": i32::MIN }),
        }
    }

    /// Something else.
    fn noise(&mut self) -> String {
        let long = "9".repeat(self.below(2000));
        match self.below(7) {
            0 => String::new(),
            1 => long,
            2 => "[".repeat(self.below(3000)),
            3 => format!("{{\"do\":\"undo\",\"file\":\"/etc/passwd\",\"x\":{long}1}}"),
            4 => "{\"do\":\"open\",\"file\":\"../../scan.nii\"}".to_owned(),
            5 => "{\"token\":\"again\"}".to_owned(),
            _ => format!("\u{0}\u{202e}{}", self.below(9)),
        }
    }
}

#[test]
fn thousands_of_hostile_messages_change_nothing_but_what_they_may() {
    let server = Server::start(Place::Port(0));
    let mut draw = Draw(3);
    let mut client = server.join(&server.links.drive);
    client.hear_of("frame", |_| true);
    let mut marks = Vec::new();
    // A hundred at a time, each time with an answer at its end.
    for round in 0..100 {
        for _ in 0..50 {
            client.send(&draw.formed());
            assert!(client.send_text(draw.noise()));
        }
        // What it has made of itself is undone, so that work doesn't grow by what is allowed.
        client.send(&json!({ "do": "drop" }));
        client.send(&json!({ "do": "reset" }));
        client.send(&json!({ "do": "save", "what": "scene" }));
        client.hear_of("file", |_| true);
        if round >= 20 {
            marks.push(memory() as f64);
        }
    }
    // The slope of a line through what it took, over all rounds.
    let middle = (marks.len() - 1) as f64 / 2.0;
    let mean = marks.iter().sum::<f64>() / marks.len() as f64;
    let rise: f64 = marks.iter().enumerate().map(|(i, m)| (i as f64 - middle) * (m - mean)).sum();
    let run: f64 = (0..marks.len()).map(|i| (i as f64 - middle).powi(2)).sum();
    let slope = rise / run * marks.len() as f64;
    assert!(slope < f64::from(8 << 20), "it grows by {slope} bytes in {} rounds", marks.len());
    // Planes that clip stay, until they are taken away.
    client.send(&json!({ "do": "look", "side": "top" }));
    let from_above =
        |angles: &Json| angles[0] == json!(0.0) && angles[1].as_f64().is_some_and(|up| up.abs() == 90.0);
    let last = client.hear_of("frame", |heard| from_above(&heard.head["figures"]["angles"]));
    for clip in last.head["figures"]["clips"].as_array().into_iter().flatten() {
        client.send(&json!({ "do": "unclip", "clip": clip["id"] }));
    }
    // It still does what it is asked.
    client.send(&json!({ "do": "look", "side": "front" }));
    client.send(&json!({ "do": "radius", "radius": 8.0 }));
    client.send(&json!({ "do": "reset_view" }));
    client.send(&json!({ "do": "map", "map": "octree" }));
    client.send(&json!({ "do": "grab", "pane": "volume", "at": [0.5, 0.5] }));
    client.hear_of("frame", |heard| !heard.head["figures"]["held"].is_null());
}

#[test]
fn a_message_that_is_too_long_ends_its_connection_alone() {
    let server = Server::start(Place::Port(0));
    let (mut long, mut other) = (server.join(&server.links.drive), server.join(&server.links.watch));
    long.hear_of("hello", |_| true);
    long.send_text(format!("{{\"do\":\"undo\"{}}}", " ".repeat(70_000)));
    let start = std::time::Instant::now();
    while long.hear().is_some() {}
    assert!(start.elapsed() < std::time::Duration::from_secs(30), "it is ended, not waited for");
    other.hear_of("frame", |_| true);
}
