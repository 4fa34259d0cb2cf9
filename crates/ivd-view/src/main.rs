//! The program `ivd-view`: the window alone, with the words that `ivd view` takes.
#![forbid(unsafe_code)]
#![cfg_attr(not(test), deny(clippy::expect_used, clippy::unwrap_used, clippy::panic))]

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;

use clap::Parser;
use ivd_artefact::{Cache, user_cache};
use ivd_core::{Classified as _, ErrorClass, Exec, Observer, shown};
use ivd_frames::Source;
use ivd_pipeline::scene::Override;
use ivd_view::{Options, run, source};

/// How one begins.
const AFTER: &str = "\
  ivd-view demo           a generated head, with a handle on its nose
  ivd-view scan.nii.gz    a scan: slices at once, the rest as soon as it is made
  ivd-view ct.nii.gz --labels organs.nii.gz --set boundary.class=5
                          a scan with its organs, of which 5 is the one that moves

In the window: choose Handle (H) and drag a surface in any picture; Look inside, under Clip,
cuts the volume's picture open; Ctrl+Z undoes; File saves a scene, which opens again here and in
`ivd pipeline`; ? lists the mouse and keyboard controls.";

/// Shows a scan in a window, where it can be deformed interactively.
#[derive(Debug, Parser)]
#[command(version, after_help = AFTER)]
struct Words {
    /// Scan, scene (.toml), saved log (.jsonl), or the word demo. Without it the window asks for a file.
    #[arg(value_name = "FILE|SCENE|SESSION|demo")]
    file: Option<PathBuf>,
    /// Use this scan instead of the scene's.
    #[arg(long, value_name = "FILE", requires = "file")]
    input: Option<PathBuf>,
    /// Labels of the scan by another program, such as a file of organs; boundary.class says which of them moves.
    #[arg(long, value_name = "FILE", requires = "file")]
    labels: Option<PathBuf>,
    /// Override a key of the scene, or of the default scene that a bare scan is opened with, such as lattice.iso=60.
    #[arg(long = "set", value_name = "stage.key=value", requires = "file")]
    overrides: Vec<Override>,
    /// Cache folder, or `off`.
    #[arg(long, value_name = "DIR|off")]
    cache: Option<PathBuf>,
    /// Worker threads. Default: one for each processor.
    #[arg(long, value_name = "N")]
    threads: Option<std::num::NonZeroU16>,
    /// Print errors only.
    #[arg(short, long)]
    quiet: bool,
}

/// What is noted, on the terminal.
struct Terminal;

impl Observer for Terminal {
    fn note(&self, message: &str) {
        say(&format!("note: {message}"));
    }
}

fn say(text: &str) {
    let _ = writeln!(std::io::stderr(), "{}", shown(text));
}

fn main() -> ExitCode {
    let words = Words::parse();
    match window(words) {
        Ok(()) => ExitCode::SUCCESS,
        Err((class, problem)) => {
            say(&format!("ivd-view: {problem}"));
            ExitCode::from(class.exit_code())
        }
    }
}

fn window(words: Words) -> Result<(), (ErrorClass, String)> {
    let mut exec = Exec::default();
    if !words.quiet {
        exec = exec.with_observer(Arc::new(Terminal));
    }
    if let Some(threads) = words.threads {
        exec = exec.with_threads(usize::from(threads.get()));
    }
    let cache = match words.cache.or_else(user_cache) {
        Some(folder) if folder == Path::new("off") => Cache::disabled(),
        Some(folder) => Cache::open(&folder).map_err(|error| (error.error_class(), error.to_string()))?,
        None => Cache::disabled(),
    };
    let (input, labels, overrides) = (words.input, words.labels, words.overrides);
    let source = words.file.map(|file| Source { input, labels, overrides, ..source(&file) });
    run(Options::new(exec, cache), source).map_err(|error| (error.error_class(), error.to_string()))
}
