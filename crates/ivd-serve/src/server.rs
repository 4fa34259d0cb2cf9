//! The server.

use std::net::{Ipv4Addr, SocketAddr};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use axum::Router;
use axum::extract::{State, WebSocketUpgrade};
use axum::http::{HeaderMap, StatusCode, Uri};
use axum::response::{IntoResponse as _, Response};
use axum::routing::get;
use axum::serve::ListenerExt as _;
use ivd_core::Exec;
use ivd_frames::{Begun, Service, Tell};

use crate::guard::{guarded, is_own};
use crate::hub::{Hub, Links};
use crate::socket::{MOST_BYTES, connected};
use crate::token::Token;
use crate::{Error, page};

/// How often it is looked whether the user has interrupted.
const LOOK: Duration = Duration::from_millis(100);

/// Where to listen.
#[derive(Debug, Clone)]
pub enum Place {
    /// On 127.0.0.1, at a port; 0 for any that is free.
    Port(u16),
    /// At a socket in the file system, which only its owner opens.
    Socket(PathBuf),
}

/// How a page is served.
#[derive(Debug, Clone)]
pub struct Options {
    /// Where to listen.
    pub place: Place,
}

/// Serves a model in a browser until it is interrupted.
///
/// - `open`: makes the model, on a thread of its own, and may tell what it does meanwhile.
/// - `ready`: is given the links as soon as somebody listens.
///
/// # Errors
/// A place that can't be listened at; what opening or drawing runs into; interruption ([`ivd_core::Error::Cancelled`]).
pub fn serve<B: Into<Begun>>(
    open: impl FnOnce(&Tell) -> Result<B, ivd_frames::Error> + Send + 'static,
    exec: &Exec,
    options: &Options,
    ready: impl FnOnce(&Links),
) -> Result<(), Error> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
    let runtime = runtime.map_err(|e| failed("starting", &e, "free some of the system's resources"))?;
    let hub = Hub::new(Token::new()?, Token::new()?);
    runtime.block_on(async {
        let listener = Listener::bind(&options.place).await?;
        let address = listener.address.clone();
        let links = hub.links(&address);
        let outputs = hub.clone();
        let service = Service::start(open, exec.clone(), move |output| outputs.take(output));
        hub.set_service(Some(service.map_err(|error| Error::Frames(Arc::new(error)))?));
        ready(&links);
        let ended = tokio::select! {
            served = listener.serve(router(hub.clone())) => served,
            error = failure(&hub) => Err(error),
            error = interruption(exec) => Err(error),
        };
        // Its thread ends before the program does.
        hub.set_service(None);
        ended
    })
}

/// Ends when the service does.
async fn failure(hub: &Hub) -> Error {
    let mut failed = hub.failed.subscribe();
    loop {
        if let Some(error) = failed.borrow_and_update().clone() {
            return Error::Frames(error);
        }
        if failed.changed().await.is_err() {
            std::future::pending::<()>().await;
        }
    }
}

/// Ends when the user interrupts.
async fn interruption(exec: &Exec) -> Error {
    loop {
        if let Err(error) = exec.check_cancelled() {
            return error.into();
        }
        tokio::time::sleep(LOOK).await;
    }
}

fn router(hub: Arc<Hub>) -> Router {
    Router::new()
        .route("/", get(page::html))
        .route("/page.js", get(page::script))
        .route("/page.css", get(page::style))
        // Browsers ask for it by themselves.
        .route("/favicon.ico", get(|| async { StatusCode::NO_CONTENT }))
        .route("/socket", get(socket))
        .layer(axum::middleware::from_fn(guarded))
        .with_state(hub)
}

/// Opens a connection, for this server's own page.
async fn socket(
    State(hub): State<Arc<Hub>>,
    headers: HeaderMap,
    uri: Uri,
    upgrade: WebSocketUpgrade,
) -> Response {
    if !is_own(&headers, &uri) {
        return (StatusCode::FORBIDDEN, "This socket is for its own page.\n").into_response();
    }
    let Ok(place) = hub.places.clone().try_acquire_owned() else {
        return (StatusCode::SERVICE_UNAVAILABLE, "There are too many connections.\n").into_response();
    };
    let upgrade = upgrade.max_message_size(MOST_BYTES).max_frame_size(MOST_BYTES);
    upgrade.on_upgrade(move |socket| connected(socket, hub, place))
}

fn failed(what: impl Into<String>, error: &std::io::Error, remedy: &'static str) -> Error {
    Error::System { what: what.into(), problem: error.to_string(), remedy }
}

/// Who listens.
struct Listener {
    address: String,
    from: From,
}

enum From {
    Tcp(tokio::net::TcpListener),
    #[cfg(unix)]
    Unix(tokio::net::UnixListener, Own),
}

/// A socket's file, which goes with it.
#[cfg(unix)]
struct Own(PathBuf);

#[cfg(unix)]
impl Drop for Own {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.0);
    }
}

impl Listener {
    async fn bind(place: &Place) -> Result<Self, Error> {
        match place {
            Place::Port(port) => {
                let address = SocketAddr::from((Ipv4Addr::LOCALHOST, *port));
                let what = || format!("listening on {address}");
                let listener = tokio::net::TcpListener::bind(address).await;
                let listener =
                    listener.map_err(|e| failed(what(), &e, "choose another --port, or 0 for any"))?;
                let port = listener.local_addr().map_err(|e| failed(what(), &e, "try again"))?.port();
                Ok(Self {
                    address: format!("http://{address}:{port}/", address = Ipv4Addr::LOCALHOST),
                    from: From::Tcp(listener),
                })
            }
            Place::Socket(path) => Self::at_path(path),
        }
    }

    #[cfg(unix)]
    fn at_path(path: &Path) -> Result<Self, Error> {
        use std::os::unix::fs::PermissionsExt as _;
        let what = || format!("listening at {}", path.display());
        let remedy = "name a file that isn't there, in a folder of your own";
        // Nobody else can come in between making it and closing it to others.
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let name =
            format!(".{}.{}", path.file_name().unwrap_or_default().to_string_lossy(), std::process::id());
        let private = folder.join(name);
        std::fs::create_dir(&private).map_err(|e| failed(what(), &e, remedy))?;
        let made = (|| {
            std::fs::set_permissions(&private, std::fs::Permissions::from_mode(0o700))?;
            let inside = private.join("s");
            let listener = tokio::net::UnixListener::bind(&inside)?;
            std::fs::set_permissions(&inside, std::fs::Permissions::from_mode(0o600))?;
            // Unlike a rename this takes nobody's place.
            std::fs::hard_link(&inside, path)?;
            std::fs::remove_file(&inside)?;
            Ok(listener)
        })();
        let _ = std::fs::remove_file(private.join("s"));
        let _ = std::fs::remove_dir(&private);
        let listener = made.map_err(|e: std::io::Error| failed(what(), &e, remedy))?;
        let from = From::Unix(listener, Own(path.to_owned()));
        Ok(Self { address: "http://127.0.0.1:PORT/".to_owned(), from })
    }

    #[cfg(not(unix))]
    fn at_path(path: &Path) -> Result<Self, Error> {
        let problem = "this system has no sockets in its file system".to_owned();
        Err(Error::System { what: format!("listening at {}", path.display()), problem, remedy: "use --port" })
    }

    async fn serve(self, router: Router) -> Result<(), Error> {
        let served = match self.from {
            From::Tcp(listener) => {
                // A frame's last bytes don't wait for more.
                let listener = listener.tap_io(|stream| _ = stream.set_nodelay(true));
                axum::serve(listener, router).await
            }
            #[cfg(unix)]
            From::Unix(listener, own) => {
                let served = axum::serve(listener, router).await;
                drop(own);
                served
            }
        };
        served.map_err(|e| failed("serving", &e, "try again"))
    }
}
