//! What every request must say, and every answer says.

use axum::extract::Request;
use axum::http::header::{self, HeaderMap, HeaderName, HeaderValue};
use axum::http::{StatusCode, Uri};
use axum::middleware::Next;
use axum::response::{IntoResponse as _, Response};

/// Names of this machine.
const HERE: [&str; 3] = ["localhost", "127.0.0.1", "[::1]"];

/// What answers say: nothing is loaded from elsewhere, kept, framed or told to others.
const SAID: [(HeaderName, &str); 6] = [
    (
        header::CONTENT_SECURITY_POLICY,
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob:; connect-src 'self'; base-uri 'none'; \
         form-action 'none'; frame-ancestors 'none'",
    ),
    (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
    (header::CACHE_CONTROL, "no-store"),
    (header::REFERRER_POLICY, "no-referrer"),
    (header::X_FRAME_OPTIONS, "DENY"),
    (HeaderName::from_static("cross-origin-resource-policy"), "same-origin"),
];

/// Whether a `Host` means this machine, whatever the port.
pub(crate) fn is_here(host: &str) -> bool {
    let is_port =
        |port: &str| !port.is_empty() && port.len() <= 5 && port.bytes().all(|b| b.is_ascii_digit());
    HERE.iter().any(|name| {
        host.strip_prefix(name)
            .is_some_and(|rest| rest.is_empty() || rest.strip_prefix(':').is_some_and(is_port))
    })
}

/// The one `Host` of a request, where it has one.
fn host(headers: &HeaderMap, uri: &Uri) -> Option<String> {
    let mut hosts = headers.get_all(header::HOST).iter();
    let (first, more) = (hosts.next(), hosts.next());
    // A request may name its whole address, which then counts.
    let named = uri.authority().map(|authority| authority.as_str().to_owned());
    let first = first.and_then(|host| host.to_str().ok()).map(str::to_owned);
    if more.is_some() || named.is_some() && named != first {
        return None;
    }
    first
}

/// Whether a socket is opened by this server's own page.
pub(crate) fn is_own(headers: &HeaderMap, uri: &Uri) -> bool {
    let mut origins = headers.get_all(header::ORIGIN).iter();
    let (Some(origin), None) = (origins.next(), origins.next()) else { return false };
    let Some(host) = host(headers, uri) else { return false };
    origin.to_str().is_ok_and(|origin| origin.strip_prefix("http://") == Some(&*host))
}

/// Refuses requests that mean another machine, and says what answers say.
pub(crate) async fn guarded(request: Request, next: Next) -> Response {
    let here = host(request.headers(), request.uri()).is_some_and(|host| is_here(&host));
    let mut answer = if here {
        next.run(request).await
    } else {
        (StatusCode::FORBIDDEN, "This server is for this machine alone.\n").into_response()
    };
    for (name, value) in SAID {
        answer.headers_mut().insert(name, HeaderValue::from_static(value));
    }
    answer
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hosts_are_this_machine_by_any_port_and_nothing_else() {
        for host in ["localhost", "localhost:8123", "127.0.0.1:1", "[::1]:65535", "[::1]"] {
            assert!(is_here(host), "{host}");
        }
        for host in [
            "",
            "example.org",
            "localhost.example.org",
            "localhost:",
            "localhost:x",
            "localhost:123456",
            "127.0.0.1.example.org",
            "127.0.0.2",
            "0.0.0.0",
            "[::]:80",
            "localhost@evil",
            "evil@localhost",
            "LOCALHOST evil",
        ] {
            assert!(!is_here(host), "{host}");
        }
    }

    #[test]
    fn origins_are_the_host_itself() {
        let own = |host: &[&str], origin: &[&str]| {
            let mut headers = HeaderMap::new();
            for (name, values) in [(header::HOST, host), (header::ORIGIN, origin)] {
                for value in values {
                    headers.append(name.clone(), HeaderValue::from_str(value).unwrap());
                }
            }
            is_own(&headers, &Uri::from_static("/socket"))
        };
        assert!(own(&["localhost:81"], &["http://localhost:81"]));
        for origin in [
            &[][..],
            &["null"],
            &["http://localhost"],
            &["https://localhost:81"],
            &["http://localhost:82"],
            &["http://127.0.0.1:81"],
            &["http://evil.example"],
            &["http://localhost:81", "http://localhost:81"],
        ] {
            assert!(!own(&["localhost:81"], origin), "{origin:?}");
        }
        assert!(!own(&[], &["http://"]) && !own(&["a", "a"], &["http://a"]));
    }
}
