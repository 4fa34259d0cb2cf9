use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::sync::mpsc::{Receiver, channel};
use std::thread::JoinHandle;
use std::time::Duration;

use ivd_artefact::Cache;
use ivd_core::Exec;
use ivd_frames::{Model, Subject, Tell};
use ivd_pipeline::scene::{Loaded, parse};
use ivd_serve::{Error, Links, Options, Place, serve};
use serde_json::{Value as Json, json};
use tungstenite::client::IntoClientRequest as _;
use tungstenite::protocol::Message;
use tungstenite::{WebSocket, client};

/// A ball of 32³ voxels of 1 mm with values that fall outwards, cut halfway.
const BALL: &str = include_str!("../../../ivd-frames/tests/frames/ball.toml");

/// A server of a small ball; it ends with the test.
pub(crate) struct Server {
    pub(crate) links: Links,
    exec: Exec,
    thread: Option<JoinHandle<Result<(), Error>>>,
}

impl Server {
    pub(crate) fn start(place: Place) -> Self {
        let (go, wait) = channel();
        go.send(()).unwrap();
        Self::start_after(place, wait)
    }

    /// The same, where what is shown can be moved only after something was sent.
    pub(crate) fn start_after(place: Place, wait: Receiver<()>) -> Self {
        let (exec, (sender, receiver)) = (Exec::default(), channel());
        let its = exec.clone();
        let thread = std::thread::spawn(move || {
            let scene = parse(&BALL.replace("size = 32", "size = 24"), &[]).unwrap();
            let loaded = Loaded { scene, folder: ".".into(), file: "scene.toml".into() };
            let open = move |tell: &Tell| {
                let exec = Exec::default();
                let subject = Subject::open(&loaded, false, &Cache::disabled(), &exec, tell)?;
                wait.recv_timeout(Duration::from_mins(1)).unwrap();
                Model::new(subject, [96, 96], exec)
            };
            serve(open, &its, &Options { place }, |links| sender.send(links.clone()).unwrap())
        });
        let links = receiver.recv_timeout(Duration::from_mins(1)).unwrap();
        Self { links, exec, thread: Some(thread) }
    }

    pub(crate) fn host(&self) -> String {
        self.links.drive.strip_prefix("http://").unwrap().split('/').next().unwrap().to_owned()
    }

    pub(crate) fn port(&self) -> u16 {
        self.host().rsplit(':').next().unwrap().parse().unwrap()
    }

    pub(crate) fn token(link: &str) -> String {
        link.split('#').nth(1).unwrap().to_owned()
    }

    /// Somebody who has said a link's token.
    pub(crate) fn join(&self, link: &str) -> Client {
        let mut client =
            Client::open(self.port(), &self.host(), Some(&format!("http://{}", self.host()))).unwrap();
        client.send(&json!({ "token": Self::token(link) }));
        client
    }

    /// Ends it, and tells how.
    pub(crate) fn end(mut self) -> Result<(), Error> {
        self.exec.cancel.cancel();
        self.thread.take().unwrap().join().unwrap()
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.exec.cancel.cancel();
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// One end of a socket.
pub(crate) struct Client(WebSocket<TcpStream>);

/// A message of the server.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Heard {
    pub(crate) head: Json,
    pub(crate) bytes: Vec<u8>,
}

impl Client {
    /// Opens a socket with these headers; the answer's status where it is refused.
    pub(crate) fn open(port: u16, host: &str, origin: Option<&str>) -> Result<Self, u16> {
        let stream = TcpStream::connect(("127.0.0.1", port)).unwrap();
        stream.set_read_timeout(Some(Duration::from_mins(1))).unwrap();
        let mut request = format!("ws://{host}/socket").into_client_request().unwrap();
        if let Some(origin) = origin {
            request.headers_mut().insert("Origin", origin.parse().unwrap());
        }
        match client(request, stream) {
            Ok((socket, _)) => Ok(Self(socket)),
            Err(tungstenite::HandshakeError::Failure(tungstenite::Error::Http(answer))) => {
                Err(answer.status().as_u16())
            }
            Err(error) => panic!("{error}"),
        }
    }

    pub(crate) fn send(&mut self, request: &Json) {
        self.0.send(Message::text(request.to_string())).unwrap();
    }

    pub(crate) fn send_text(&mut self, text: String) -> bool {
        self.0.send(Message::text(text)).is_ok()
    }

    /// The next message; `None` at the end of the connection.
    pub(crate) fn hear(&mut self) -> Option<Heard> {
        loop {
            match self.0.read() {
                Ok(Message::Text(text)) => {
                    return Some(Heard { head: serde_json::from_str(&text).unwrap(), bytes: Vec::new() });
                }
                Ok(Message::Binary(bytes)) => {
                    let length = u32::from_le_bytes(bytes[..4].try_into().unwrap()) as usize;
                    let head = serde_json::from_slice(&bytes[4..4 + length]).unwrap();
                    return Some(Heard { head, bytes: bytes[4 + length..].to_vec() });
                }
                Ok(Message::Close(_)) | Err(_) => return None,
                Ok(_) => {}
            }
        }
    }

    /// The next message of a kind for which something holds.
    pub(crate) fn hear_of(&mut self, kind: &str, holds: impl Fn(&Heard) -> bool) -> Heard {
        loop {
            let heard = self.hear().unwrap_or_else(|| panic!("the connection ended before a {kind}"));
            if heard.head["kind"] == kind && holds(&heard) {
                return heard;
            }
        }
    }
}

/// An answer over plain HTTP: status line and headers, and the body.
pub(crate) fn get(port: u16, path: &str, host: &str) -> (String, String) {
    let mut stream = TcpStream::connect(("127.0.0.1", port)).unwrap();
    stream.set_read_timeout(Some(Duration::from_mins(1))).unwrap();
    write!(stream, "GET {path} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n").unwrap();
    let mut all = String::new();
    stream.read_to_string(&mut all).unwrap();
    let (head, body) = all.split_once("\r\n\r\n").unwrap();
    (head.to_ascii_lowercase(), body.to_owned())
}
