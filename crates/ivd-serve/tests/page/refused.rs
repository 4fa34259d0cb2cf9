//! Who isn't let in.

use std::time::{Duration, Instant};

use ivd_core::{Classified as _, ErrorClass};
use ivd_frames::{Error, Model, Tell};
use ivd_serve::Place;
use serde_json::json;

use super::common::{Client, Server, get};

#[test]
fn the_page_is_for_this_machine_and_loads_nothing_from_elsewhere() {
    let server = Server::start(Place::Port(0));
    let port = server.port();
    for (path, word) in [("/", "<title>"), ("/page.js", "WebSocket"), ("/page.css", "grid")] {
        let (head, body) = get(port, path, &server.host());
        assert!(head.starts_with("http/1.1 200") && body.contains(word), "{path}: {head}");
        for said in [
            "default-src 'none'",
            "frame-ancestors 'none'",
            "x-content-type-options: nosniff",
            "cache-control: no-store",
            "referrer-policy: no-referrer",
        ] {
            assert!(head.contains(said), "{path} doesn't say {said}: {head}");
        }
        assert!(!body.contains("https://") && !body.contains(&Server::token(&server.links.drive)));
        // Other ports are those of tunnels; other names are other machines'.
        for host in ["localhost:1", "127.0.0.1", "[::1]:99"] {
            assert!(get(port, path, host).0.starts_with("http/1.1 200"), "{host}");
        }
        for host in ["example.org", "localhost.example.org", "127.0.0.1.nip.io:80", "10.0.0.1"] {
            assert!(get(port, path, host).0.starts_with("http/1.1 403"), "{host}");
        }
    }
    assert!(get(port, "/etc/passwd", &server.host()).0.starts_with("http/1.1 404"));
    assert_eq!(server.end().unwrap_err().error_class(), ErrorClass::Cancelled);
}

#[test]
fn sockets_are_for_the_page_itself() {
    let server = Server::start(Place::Port(0));
    let (port, host) = (server.port(), server.host());
    let own = format!("http://{host}");
    for origin in
        [None, Some("null"), Some("http://evil.example"), Some("http://localhost"), Some("https://localhost")]
    {
        assert_eq!(Client::open(port, &host, origin).err(), Some(403), "{origin:?}");
    }
    for other in ["evil.example", "127.0.0.1.evil.example"] {
        assert_eq!(Client::open(port, other, Some(&format!("http://{other}"))).err(), Some(403), "{other}");
    }
    assert_eq!(Client::open(port, &host, Some("http://127.0.0.1:1")).err(), Some(403));
    assert!(Client::open(port, &host, Some(&own)).is_ok());
    // A tunnel's port is another one, the same in both.
    let tunnel = "localhost:41234";
    assert!(Client::open(port, tunnel, Some(&format!("http://{tunnel}"))).is_ok());
}

#[test]
fn who_does_not_say_a_token_is_sent_away() {
    let server = Server::start(Place::Port(0));
    let wrong = [
        json!({}),
        json!({ "token": "" }),
        json!({ "token": "0".repeat(32) }),
        json!({ "token": format!("{}0", Server::token(&server.links.drive)) }),
        json!({ "do": "undo" }),
        json!({ "token": 7 }),
    ];
    let own = format!("http://{}", server.host());
    for said in wrong {
        let mut client = Client::open(server.port(), &server.host(), Some(&own)).unwrap();
        client.send(&said);
        let heard = client.hear().unwrap();
        assert!(heard.head["kind"] == "refused" && client.hear().is_none(), "{said}");
    }
    let start = Instant::now();
    let mut silent = Client::open(server.port(), &server.host(), Some(&own)).unwrap();
    assert_eq!(silent.hear().unwrap().head["kind"], "refused");
    assert!(start.elapsed() >= Duration::from_secs(4), "they have five seconds");
}

#[test]
fn there_are_at_most_eight() {
    let server = Server::start(Place::Port(0));
    let mut all: Vec<Client> = (0..8).map(|_| server.join(&server.links.watch)).collect();
    for client in &mut all {
        client.hear_of("hello", |_| true);
    }
    let own = format!("http://{}", server.host());
    assert_eq!(Client::open(server.port(), &server.host(), Some(&own)).err(), Some(503));
    drop(all.pop());
    let start = Instant::now();
    while Client::open(server.port(), &server.host(), Some(&own)).is_err() {
        assert!(start.elapsed() < Duration::from_mins(1), "a place that is left is free again");
        std::thread::sleep(Duration::from_millis(20));
    }
}

#[cfg(unix)]
#[test]
fn a_socket_in_the_file_system_is_its_owners() {
    use std::io::{Read as _, Write as _};
    use std::os::unix::fs::PermissionsExt as _;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("ivd.sock");
    let server = Server::start(Place::Socket(path.clone()));
    assert_eq!(std::fs::metadata(&path).unwrap().permissions().mode() & 0o777, 0o600);
    let mut stream = std::os::unix::net::UnixStream::connect(&path).unwrap();
    write!(stream, "GET / HTTP/1.1\r\nHost: localhost:8123\r\nConnection: close\r\n\r\n").unwrap();
    let mut all = String::new();
    stream.read_to_string(&mut all).unwrap();
    assert!(all.starts_with("HTTP/1.1 200") && all.contains("<title>"), "{all}");
    drop(server);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "nothing is left");
    // What is there is nobody's to replace.
    std::fs::write(&path, "mine").unwrap();
    let open = |_: &Tell| -> Result<Model, Error> { panic!("nobody listens") };
    let options = ivd_serve::Options { place: Place::Socket(path.clone()) };
    let error = ivd_serve::serve(open, &ivd_core::Exec::default(), &options, |_| ()).unwrap_err();
    assert!(error.to_string().contains("ivd.sock") && error.error_class() == ErrorClass::Io, "{error}");
    assert_eq!(std::fs::read_to_string(&path).unwrap(), "mine");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}
