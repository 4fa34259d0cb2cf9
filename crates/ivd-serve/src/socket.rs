//! One connection.

use std::sync::Arc;
use std::time::Duration;

use axum::body::Bytes;
use axum::extract::ws::{Message, WebSocket};
use ivd_frames::{Client, Picture, Request};
use serde::Deserialize;
use serde_json::{Value as Json, json};
use tokio::sync::OwnedSemaphorePermit;
use tokio::time::timeout;

use crate::hub::{Answer, Hub, Role, Said, Shown, problem};

/// Most bytes of a message.
pub(crate) const MOST_BYTES: usize = 64 << 10;
/// Who doesn't say who they are within so long is nobody.
const TO_SAY_WHO: Duration = Duration::from_secs(5);
/// Who doesn't take what is sent for so long is gone.
const TO_TAKE: Duration = Duration::from_secs(20);

/// The same of a file.
const TO_TAKE_FILE: Duration = Duration::from_mins(30);

/// The first message.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Hello {
    token: String,
}

/// What is done about the wheel.
#[derive(Deserialize)]
#[serde(tag = "do", rename_all = "snake_case", deny_unknown_fields)]
enum About {
    Take,
    HandOver,
}

/// Why a connection ends.
struct Gone;

/// What a connection has of each pane: version, and by how much it is coarser.
#[derive(Default)]
struct Has {
    pictures: [Option<(u64, usize)>; 4],
    /// Whether these are a frame's: a scan's have versions of their own.
    of_frame: bool,
}

/// Serves a connection until it ends.
pub(crate) async fn connected(mut socket: WebSocket, hub: Arc<Hub>, place: OwnedSemaphorePermit) {
    let said = timeout(TO_SAY_WHO, socket.recv()).await;
    let role = match said {
        Ok(Some(Ok(Message::Text(text)))) => {
            serde_json::from_str::<Hello>(&text).ok().and_then(|hello| hub.role(&hello.token))
        }
        _ => None,
    };
    let Some(role) = role else {
        let word = json!({ "kind": "refused", "text": "the link's token is missing or wrong: take the whole link that ivd serve printed" });
        let _ = timeout(TO_TAKE, socket.send(text(&word))).await;
        return;
    };
    let (client, said) = hub.enter();
    let served = serve(&mut socket, &hub, client, role, said).await;
    hub.leave(client);
    drop((served, place));
}

async fn serve(
    socket: &mut WebSocket,
    hub: &Hub,
    client: Client,
    role: Role,
    mut said: Said,
) -> Result<(), Gone> {
    let (mut shown, mut driving) = (hub.shown(), hub.driving());
    let mut has = Has::default();
    send(socket, text(&json!({ "kind": "hello", "may_drive": role == Role::Driver }))).await?;
    loop {
        tokio::select! {
            message = socket.recv() => match message {
                Some(Ok(Message::Text(said))) => follow(hub, client, role, &said),
                Some(Ok(Message::Binary(_))) => hub.say(client, problem("messages are text")),
                Some(Ok(Message::Ping(_) | Message::Pong(_))) => {}
                Some(Ok(Message::Close(_)) | Err(_)) | None => return Err(Gone),
            },
            Some(word) = said.words.recv() => send(socket, text(&word)).await?,
            Some(file) = said.files.recv() => {
                let sent = send_file(socket, file).await;
                hub.has_file(client);
                sent?;
            },
            Ok(()) = driving.changed() => {
                let driver = *driving.borrow_and_update();
                let word = json!({ "kind": "wheel", "drives": driver == Some(client), "free": driver.is_none() });
                send(socket, text(&word)).await?;
            },
            Ok(()) = shown.changed() => {
                let shown = shown.borrow_and_update().clone();
                if let Some(shown) = shown {
                    send(socket, of_shown(&shown, &mut has)).await?;
                }
            },
        }
    }
}

/// Does what a message asks for.
fn follow(hub: &Hub, client: Client, role: Role, said: &str) {
    if role == Role::Watcher {
        return hub.say(client, problem("this link lets watch; who drives has another"));
    }
    if let Ok(about) = serde_json::from_str::<About>(said) {
        match about {
            About::HandOver => hub.let_go(client),
            About::Take if hub.drives(client, true) => {}
            About::Take => hub.say(
                client,
                problem("somebody else drives: ask them to hand over, or wait for half a minute"),
            ),
        }
        return;
    }
    match serde_json::from_str::<Request>(said) {
        Ok(request) => match request.check() {
            Ok(()) if hub.drives(client, false) => hub.ask(client, request),
            Ok(()) => hub.say(client, problem("somebody else drives")),
            Err(error) => hub.say(client, problem(&error.to_string())),
        },
        Err(error) => hub.say(client, problem(&format!("no request: {error}"))),
    }
}

async fn send(socket: &mut WebSocket, message: Message) -> Result<(), Gone> {
    match timeout(TO_TAKE, socket.send(message)).await {
        Ok(Ok(())) => Ok(()),
        _ => Err(Gone),
    }
}

/// Sends a file, or why there is none.
async fn send_file(socket: &mut WebSocket, file: Answer) -> Result<(), Gone> {
    let file = match file {
        Ok(file) => file,
        Err(why) => return send(socket, text(&problem(&why))).await,
    };
    let head = json!({ "kind": "file", "name": file.name, "bytes": file.bytes.len() });
    // A file takes as long as its way is slow.
    match timeout(TO_TAKE_FILE, socket.send(binary(&head, &[&file.bytes]))).await {
        Ok(Ok(())) => Ok(()),
        _ => Err(Gone),
    }
}

fn text(word: &Json) -> Message {
    Message::Text(word.to_string().into())
}

/// A message of a head and bytes: the head's length in four bytes, the lowest first, the head, the bytes.
fn binary(head: &Json, parts: &[&[u8]]) -> Message {
    let head = head.to_string();
    let mut bytes = Vec::with_capacity(4 + head.len() + parts.iter().map(|part| part.len()).sum::<usize>());
    bytes.extend((head.len() as u32).to_le_bytes());
    bytes.extend(head.as_bytes());
    for part in parts {
        bytes.extend(*part);
    }
    Message::Binary(Bytes::from(bytes))
}

/// A scan or a frame, with those of its pictures that a connection doesn't have.
fn of_shown(shown: &Shown, has: &mut Has) -> Message {
    match shown {
        Shown::Scan(scan) => {
            let (told, parts) = has.lacks(scan.all_pictures());
            let volume = scan.volume.as_ref();
            let figures = json!({
                "size": volume.map(|volume| volume.size),
                "width_mm": volume.map(|volume| volume.width_mm),
                "letters": volume.and_then(|volume| volume.letters),
                "slices": scan.slices, "cross_at": scan.cross_at, "hovered": scan.hovered,
            });
            binary(&json!({ "kind": "scan", "figures": figures, "pictures": told }), &parts)
        }
        Shown::Frame(frame) => {
            if !has.of_frame {
                *has = Has { of_frame: true, ..Has::default() };
            }
            let (told, parts) = has.lacks(frame.pictures.iter().map(Arc::as_ref));
            let head = json!({ "kind": "frame", "number": frame.number, "figures": frame.figures, "pictures": told });
            binary(&head, &parts)
        }
    }
}

impl Has {
    /// What it has not, from now on it has: what is told of pictures, and their files.
    fn lacks<'a>(&mut self, pictures: impl Iterator<Item = &'a Picture>) -> (Vec<Json>, Vec<&'a [u8]>) {
        let (mut told, mut parts) = (Vec::new(), Vec::new());
        for picture in pictures {
            let (number, now) = (picture.pane.number(), Some((picture.version, picture.coarser)));
            if self.pictures[number] == now {
                continue;
            }
            let Ok(png) = picture.png() else { continue };
            self.pictures[number] = now;
            let (width, height) = (picture.image.width(), picture.image.height());
            told.push(json!({
                "pane": picture.pane, "version": picture.version, "coarser": picture.coarser, "width": width, "height": height, "bytes": png.len(),
            }));
            parts.push(png);
        }
        (told, parts)
    }
}
