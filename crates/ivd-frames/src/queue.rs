//! What waits to be done.

use std::collections::VecDeque;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use crate::Request;

/// Whoever asks, so that answers find them.
pub type Client = u64;

/// Requests that wait at most, but for what ends something.
const MOST: usize = 256;

/// Requests in their order, those merged that do one another's work.
#[derive(Debug, Default)]
pub(crate) struct Queue {
    waiting: Mutex<Waiting>,
    changed: Condvar,
}

#[derive(Debug, Default)]
struct Waiting {
    requests: VecDeque<(Client, Request)>,
    /// How many were taken in, those that were merged into another apart, and how many have left.
    pushed: u64,
    left: u64,
    /// There is something to look at beside the queue.
    woken: bool,
    ends: bool,
    /// Something is opened: who is forgotten meanwhile.
    forgotten: Option<Vec<Client>>,
}

/// What comes next.
#[derive(Debug)]
pub(crate) enum Next {
    Request(Client, Request),
    /// There is something to look at beside the queue.
    Woken,
    /// Nothing for as long as was waited.
    Nothing,
    /// The service ends.
    End,
}

impl Queue {
    fn locked(&self) -> MutexGuard<'_, Waiting> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes a request, unless too many wait. What lets go of something is always taken.
    pub(crate) fn push(&self, client: Client, request: Request) -> bool {
        let mut waiting = self.locked();
        // Where a hand that gives up has been isn't gone to any more.
        let goes = |(who, last): &(Client, Request)| *who == client && matches!(last, Request::Drag { .. });
        while request == Request::Abandon && waiting.requests.back().is_some_and(goes) {
            waiting.requests.pop_back();
            waiting.left += 1;
        }
        if let Some((who, last)) = waiting.requests.back_mut() {
            // What isn't allowed is refused by itself: merged, it would take what is allowed with it.
            let both = request.check().is_ok() && last.check().is_ok();
            if *who == client && both && last.merge(&request) {
                return true;
            }
        }
        if waiting.requests.len() >= MOST && !matches!(request, Request::Drop | Request::Abandon) {
            return false;
        }
        waiting.requests.push_back((client, request));
        waiting.pushed += 1;
        drop(waiting);
        self.changed.notify_one();
        true
    }

    /// Whether what somebody holds now is given up by what waits: not something that is taken hold of later.
    pub(crate) fn gives_up(&self, client: Client) -> bool {
        let waiting = self.locked();
        let ends = |(who, request): &&(Client, Request)| {
            *who == client && matches!(request, Request::Abandon | Request::Drop | Request::Grab { .. })
        };
        waiting.requests.iter().find(ends).is_some_and(|(_, request)| *request == Request::Abandon)
    }

    /// Lets go of all that somebody asked for.
    pub(crate) fn forget(&self, client: Client) {
        let mut waiting = self.locked();
        let before = waiting.requests.len();
        waiting.requests.retain(|(who, _)| *who != client);
        waiting.left += (before - waiting.requests.len()) as u64;
        if let Some(forgotten) = &mut waiting.forgotten {
            forgotten.push(client);
        }
    }

    /// Something is opened, or no longer; who was forgotten since the last call.
    pub(crate) fn opens(&self, opens: bool) -> Vec<Client> {
        std::mem::replace(&mut self.locked().forgotten, opens.then(Vec::new)).unwrap_or_default()
    }

    /// Wakes whoever waits.
    pub(crate) fn wake(&self) {
        self.locked().woken = true;
        self.changed.notify_one();
    }

    pub(crate) fn end(&self) {
        self.locked().ends = true;
        self.changed.notify_one();
    }

    /// Number of the last request that was taken in, from 1.
    pub(crate) fn pushed(&self) -> u64 {
        self.locked().pushed
    }

    /// Number of the last that has left.
    pub(crate) fn left(&self) -> u64 {
        self.locked().left
    }

    /// Whether anything waits.
    pub(crate) fn is_empty(&self) -> bool {
        let waiting = self.locked();
        waiting.requests.is_empty() && !waiting.ends
    }

    /// The next request; waits for one, at most so long where that is said.
    pub(crate) fn next(&self, at_most: Option<Duration>) -> Next {
        let until = at_most.map(|time| Instant::now() + time);
        let mut waiting = self.locked();
        loop {
            if waiting.ends {
                return Next::End;
            }
            if std::mem::take(&mut waiting.woken) {
                return Next::Woken;
            }
            if let Some((client, request)) = waiting.requests.pop_front() {
                waiting.left += 1;
                return Next::Request(client, request);
            }
            let left = until.map(|until| until.saturating_duration_since(Instant::now()));
            waiting = match left {
                None => self.changed.wait(waiting).unwrap_or_else(PoisonError::into_inner),
                Some(Duration::ZERO) => return Next::Nothing,
                Some(left) => {
                    self.changed.wait_timeout(waiting, left).unwrap_or_else(PoisonError::into_inner).0
                }
            };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn requests_merge_and_what_lets_go_is_never_refused() {
        let queue = Queue::default();
        let orbit = |x| Request::Orbit { by: [x, 0.0] };
        assert!(queue.push(1, orbit(0.1)) && queue.push(1, orbit(f64::NAN)) && queue.push(1, orbit(0.2)));
        assert!(queue.push(1, orbit(0.3)));
        let first = queue.next(None);
        assert!(matches!(&first, Next::Request(1, Request::Orbit { by }) if by[0] == 0.1), "{first:?}");
        assert!(matches!(queue.next(None), Next::Request(1, Request::Orbit { by }) if by[0].is_nan()));
        assert!(
            matches!(queue.next(None), Next::Request(1, Request::Orbit { by }) if (by[0] - 0.5).abs() < 1e-12)
        );
        let mut taken = 0;
        while queue.push(taken % 2, Request::Undo) {
            taken += 1;
        }
        assert_eq!(taken as usize, MOST);
        assert!(queue.push(0, Request::Abandon) && queue.push(1, Request::Drop));
        queue.forget(0);
        let mut left = 0;
        while let Next::Request(client, _) = queue.next(Some(Duration::ZERO)) {
            assert_eq!(client, 1);
            left += 1;
        }
        assert_eq!(left, MOST / 2 + 1);
        queue.end();
        assert!(matches!(queue.next(None), Next::End) && !queue.is_empty());
    }
}
