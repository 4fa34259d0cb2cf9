//! `measure frames SCAN|SCENE.toml [EVENTS]`: a handle that is dragged through the frame service, and how soon pictures follow, as JSON.

use ivd_bench::followed;
use ivd_core::Exec;
use ivd_frames::Source;

use crate::Anything;

pub(crate) const USAGE: &str = "SCAN|SCENE.toml [EVENTS]";
/// Worker threads.
const THREADS: usize = 2;

pub(crate) fn run(words: &[String]) -> Anything<()> {
    let [file, rest @ ..] = words else { return Err(USAGE.into()) };
    let count = rest.first().map_or(Ok(400), |text| text.parse())?;
    let source = Source { file: Some(file.into()), ..Source::default() };
    let found = followed(&source, count, &Exec::default().with_threads(THREADS));
    let mut found = found.map_err(|problem| problem.to_string())?;
    found.event_ms.clear();
    println!("{}", serde_json::to_string(&found)?);
    Ok(())
}
