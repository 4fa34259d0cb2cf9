//! Members of a list that keep their numbers while others come and go.

use std::ops::Deref;

use serde::{Deserialize, Serialize};

use crate::Error;

/// What a member of a list is called by, for as long as a session lasts: no other member gets the same number.
pub type Id = u32;

/// A member of a list, with the number that it is called by.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Numbered<T> {
    /// Its number.
    pub id: Id,
    /// What it is.
    #[serde(flatten)]
    pub what: T,
}

impl<T> Deref for Numbered<T> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.what
    }
}

/// Members with the numbers 0, 1, 2 …
pub fn numbered<T>(all: impl IntoIterator<Item = T>) -> Vec<Numbered<T>> {
    (0..).zip(all).map(|(id, what)| Numbered { id, what }).collect()
}

/// The members themselves, in their order.
pub(crate) fn plain<T: Clone>(all: &[Numbered<T>]) -> Vec<T> {
    all.iter().map(|one| one.what.clone()).collect()
}

/// The first number that is above all others.
pub(crate) fn next_id<T>(all: &[Numbered<T>]) -> Id {
    all.iter().map(|one| one.id.saturating_add(1)).max().unwrap_or(0)
}

/// Puts a member behind the others.
pub(crate) fn add<T>(
    what: &'static str,
    all: &mut Vec<Numbered<T>>,
    id: Option<Id>,
    member: T,
) -> Result<(), Error> {
    let id = id.unwrap_or_else(|| next_id(all));
    if all.iter().any(|one| one.id == id) {
        return Err(Error::Event {
            event: "add",
            problem: format!("{what} {id} is there already"),
            remedy: "leave the number out",
        });
    }
    all.push(Numbered { id, what: member });
    Ok(())
}

/// Where the member of a number is.
fn place<T>(event: &'static str, what: &str, all: &[Numbered<T>], id: Id) -> Result<usize, Error> {
    all.iter().position(|one| one.id == id).ok_or_else(|| Error::Event {
        event,
        problem: match &*all.iter().map(|one| one.id.to_string()).collect::<Vec<_>>().join(", ") {
            "" => format!("there is no {what} {id}, nor any other"),
            there => format!("there is no {what} {id}; there are {there}"),
        },
        remedy: "name one that is there",
    })
}

/// The member of a number.
pub(crate) fn at<'a, T>(
    event: &'static str,
    what: &str,
    all: &'a mut [Numbered<T>],
    id: Id,
) -> Result<&'a mut T, Error> {
    let place = place(event, what, all, id)?;
    Ok(&mut all[place].what)
}

/// Takes the member of a number out.
pub(crate) fn take<T>(
    event: &'static str,
    what: &str,
    all: &mut Vec<Numbered<T>>,
    id: Id,
) -> Result<(), Error> {
    let place = place(event, what, all, id)?;
    all.remove(place);
    Ok(())
}
