//! One connection.

use std::sync::Arc;
use std::time::Duration;

use axum::body::Bytes;
use axum::extract::ws::{Message, WebSocket};
use ivd_frames::{Client, Frame, Pane, Request};
use serde::Deserialize;
use serde_json::{Value as Json, json};
use tokio::sync::OwnedSemaphorePermit;
use tokio::time::timeout;

use crate::hub::{Hub, Role, Word, problem};

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
type Has = [Option<(u64, usize)>; 4];

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
    let (client, words) = hub.enter();
    let served = serve(&mut socket, &hub, client, role, words).await;
    hub.leave(client);
    drop((served, place));
}

async fn serve(
    socket: &mut WebSocket,
    hub: &Hub,
    client: Client,
    role: Role,
    mut words: tokio::sync::mpsc::Receiver<Word>,
) -> Result<(), Gone> {
    let (mut frames, mut driving) = (hub.frames(), hub.driving());
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
            Some(word) = words.recv() => match word {
                Word::Text(word) => send(socket, text(&word)).await?,
                Word::File(file) => {
                    let head = json!({ "kind": "file", "name": file.name, "bytes": file.bytes.len() });
                    // A file takes as long as its way is slow.
                    let sent = timeout(TO_TAKE_FILE, socket.send(binary(&head, &[&file.bytes]))).await;
                    hub.has_file(client);
                    sent.map_err(|_| Gone)?.map_err(|_| Gone)?;
                }
            },
            Ok(()) = driving.changed() => {
                let driver = *driving.borrow_and_update();
                let word = json!({ "kind": "wheel", "drives": driver == Some(client), "free": driver.is_none() });
                send(socket, text(&word)).await?;
            },
            Ok(()) = frames.changed() => {
                let frame = frames.borrow_and_update().clone();
                if let Some(frame) = frame {
                    send(socket, of_frame(&frame, &mut has)).await?;
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

/// A frame, with those of its pictures that a connection doesn't have.
fn of_frame(frame: &Frame, has: &mut Has) -> Message {
    let (mut told, mut parts) = (Vec::new(), Vec::new());
    for pane in Pane::ALL {
        let picture = &frame.pictures[pane.number()];
        let now = Some((picture.version, picture.coarser));
        if has[pane.number()] == now {
            continue;
        }
        let Ok(png) = picture.png() else { continue };
        has[pane.number()] = now;
        let (width, height) = (picture.image.width(), picture.image.height());
        told.push(json!({
            "pane": pane, "version": picture.version, "coarser": picture.coarser, "width": width, "height": height, "bytes": png.len(),
        }));
        parts.push(png);
    }
    let head = json!({ "kind": "frame", "number": frame.number, "figures": frame.figures, "pictures": told });
    binary(&head, &parts)
}
