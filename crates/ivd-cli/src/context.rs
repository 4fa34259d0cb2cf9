//! What was typed, made into what it means: threads, memory, cache, observer.

use std::io::{IsTerminal as _, Write as _};
use std::path::Path;
use std::sync::Arc;

use ivd_artefact::{Cache, Loaded, user_cache};
use ivd_core::{ErrorClass, Exec, shown};
use ivd_pipeline::{Input, Runner, Stage, StageResult};
use serde::Serialize;

use crate::args::{Global, When};
use crate::exit::Failure;
use crate::gpu;
use crate::guard::{Guard, TemporaryRoom};
use crate::progress::{Progress, Style};
use crate::talk;

/// The context of one command.
pub(crate) struct Context {
    /// Threads, memory, observer.
    pub(crate) exec: Exec,
    /// Flags as typed.
    pub(crate) global: Global,
    /// Holds the process to the memory limit.
    pub(crate) guard: Guard,
}

impl Context {
    /// Sets up logs, interruption, threads and bars.
    pub(crate) fn new(global: &Global) -> anyhow::Result<Self> {
        logs(global);
        let device = gpu::device(global)?;
        let style = match (global.progress, std::io::stderr().is_terminal()) {
            (When::Never, _) => Style::Silent,
            (When::Auto, _) if global.quiet => Style::Silent,
            (_, true) => Style::Bars,
            (_, false) => Style::Lines,
        };
        let progress = Arc::new(Progress::new(style, !global.quiet));
        let mut exec = Exec::default().with_observer(progress).with_memory_limit(global.memory_limit);
        exec = exec.with_spill(Arc::new(TemporaryRoom::beyond(global.memory_limit)));
        exec.skip = !global.no_skip;
        exec = exec.with_simd(!global.no_simd);
        if let Some(threads) = global.threads {
            exec = exec.with_threads(usize::from(threads));
        }
        let cancel = exec.cancel.clone();
        let handler = move || {
            if cancel.is_cancelled() {
                std::process::exit(130);
            }
            cancel.cancel();
        };
        if let Err(error) = ctrlc::set_handler(handler) {
            tracing::warn!(%error, "interruption won't be tidy");
        }
        let guard = match global.memory_limit {
            Some(limit) => Guard::start(limit, exec.cancel.clone()),
            None => Guard::default(),
        };
        if let Some(device) = device {
            exec = exec.with_device(Arc::new(device));
        }
        Ok(Self { exec, global: global.clone(), guard })
    }

    /// The cache of a pipeline: the folder given, else the user's.
    pub(crate) fn pipeline_cache(&self) -> anyhow::Result<Cache> {
        match &self.global.cache {
            Some(dir) if dir == Path::new("off") => Ok(Cache::disabled()),
            Some(dir) => Ok(Cache::open(dir)?),
            None => match user_cache() {
                Some(dir) => Ok(Cache::open(dir)?),
                None => Ok(Cache::disabled()),
            },
        }
    }

    /// The cache of a single stage: only where a folder is given.
    pub(crate) fn stage_cache(&self) -> anyhow::Result<Cache> {
        if self.global.cache.is_some() { self.pipeline_cache() } else { Ok(Cache::disabled()) }
    }

    /// Runs one stage.
    pub(crate) fn run(
        &self,
        cache: &Cache,
        stage: &dyn Stage,
        inputs: &ivd_pipeline::Inputs,
    ) -> anyhow::Result<StageResult> {
        Ok(Runner { exec: &self.exec, cache, lazy: false }.run(stage, inputs, false)?)
    }

    /// Prints data: a JSON object where that was asked for, with every character as it is, else text as it is shown.
    pub(crate) fn print(&self, object: &impl Serialize, text: impl FnOnce() -> String) -> anyhow::Result<()> {
        self.print_verbatim(object, || shown(&text()).into_owned())
    }

    /// Prints data that another program reads, as it is: a JSON object where that was asked for, else text.
    pub(crate) fn print_verbatim(
        &self,
        object: &impl Serialize,
        text: impl FnOnce() -> String,
    ) -> anyhow::Result<()> {
        let mut out = std::io::stdout().lock();
        if self.global.json {
            writeln!(out, "{}", serde_json::to_string(object)?)?;
        } else {
            let text = text();
            if !text.is_empty() {
                writeln!(out, "{text}")?;
            }
        }
        Ok(())
    }

    /// Says something to a person, unless that is not wanted.
    pub(crate) fn say(&self, text: &str) {
        if !self.global.quiet {
            talk::say(text);
        }
    }

    /// An artefact file, verified whole.
    pub(crate) fn artefact(&self, path: &Path) -> anyhow::Result<Input> {
        self.read(path, ivd_artefact::read)
    }

    /// An artefact file as the input of a stage, which reads of a volume what it needs.
    pub(crate) fn stage_input(&self, path: &Path) -> anyhow::Result<Input> {
        self.read(path, ivd_artefact::read_lazily)
    }

    fn read<'a>(
        &self,
        path: &'a Path,
        read: impl FnOnce(&'a Path) -> Result<Loaded, ivd_artefact::Error> + Send,
    ) -> anyhow::Result<Input> {
        if path.exists() && !ivd_artefact::is_artefact(path) {
            return Err(Failure::of(
                ErrorClass::Input,
                format!(
                    "{}: not an artefact (`ivd import` makes one of a volume file, with --displacement of a field of vectors)",
                    path.display()
                ),
            ));
        }
        Ok(Input::from(self.exec.run(|| read(path))?))
    }
}

fn logs(global: &Global) {
    let level = match (global.quiet, global.verbose) {
        (true, _) => "error",
        (_, 0) => "warn",
        (_, 1) => "info",
        _ => "debug",
    };
    let filter = tracing_subscriber::EnvFilter::try_from_env("IVD_LOG").unwrap_or_else(|_| {
        tracing_subscriber::EnvFilter::new(format!("warn,ivd={level},ivd_pipeline={level}"))
    });
    let _ = tracing_subscriber::fmt()
        .with_env_filter(filter)
        // Colours are control characters too.
        .with_ansi(false)
        .with_writer(|| talk::Shown)
        .without_time()
        .try_init();
}
