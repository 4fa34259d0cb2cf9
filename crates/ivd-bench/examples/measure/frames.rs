//! `measure frames SCAN|SCENE.toml [EVENTS [KEY=VALUE …]]`: a handle that is dragged through the frame service, and how soon pictures follow, as JSON.
//! Keys are those of scenes: `map.method=biharmonic` drags by the smoothest map.

use ivd_bench::followed;
use ivd_core::Exec;
use ivd_frames::Source;

use crate::Anything;

pub(crate) const USAGE: &str = "SCAN|SCENE.toml [EVENTS [KEY=VALUE …]]";
/// Worker threads.
const THREADS: usize = 2;

pub(crate) fn run(words: &[String]) -> Anything<()> {
    let [file, rest @ ..] = words else { return Err(USAGE.into()) };
    let count = rest.first().map_or(Ok(400), |text| text.parse())?;
    let overrides = rest.iter().skip(1).map(|text| text.parse()).collect::<Result<_, _>>()?;
    let source = Source { file: Some(file.into()), overrides, ..Source::default() };
    let found = followed(&source, count, &Exec::default().with_threads(THREADS));
    let mut found = found.map_err(|problem| problem.to_string())?;
    found.event_ms.clear();
    println!("{}", serde_json::to_string(&found)?);
    Ok(())
}
