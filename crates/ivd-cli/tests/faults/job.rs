use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;

use ivd_faults::{Fault, Operation, Outcome, run};
use tempfile::TempDir;

use crate::hostile::case::every;

/// A folder with inputs, an output folder `out` and maybe a cache `cache`.
pub(crate) struct Job {
    name: String,
    folder: TempDir,
}

/// What came of all the faults.
#[derive(Debug, Default)]
pub(crate) struct Verdict {
    /// Faults that were tried.
    pub(crate) runs: usize,
    /// Runs after which every output was the old one.
    pub(crate) untouched: usize,
    /// Runs after which every output was the new one.
    pub(crate) replaced: usize,
    /// Runs that ended with exit code 7.
    pub(crate) refused: usize,
    /// Runs that succeeded although a write of the cache failed.
    pub(crate) uncached: usize,
    /// Runs that were killed.
    pub(crate) killed: usize,
}

type Files = BTreeMap<PathBuf, Vec<u8>>;

/// A line's words.
pub(crate) fn words(line: &str) -> Vec<String> {
    line.split_whitespace().map(str::to_owned).collect()
}

fn command(at: &Path, words: &[String]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_ivd"));
    command
        .current_dir(at)
        .args(words)
        .args(["-q", "--threads", "1"])
        .env("IVD_CACHE", at.join("user-cache"));
    command
}

impl Job {
    pub(crate) fn new(name: &str) -> Self {
        let job = Self { name: name.to_owned(), folder: tempfile::tempdir().unwrap() };
        std::fs::create_dir(job.path("out")).unwrap();
        job
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Runs a command that must succeed.
    pub(crate) fn must(&self, words: &[String]) {
        let output = command(self.folder.path(), words).output().unwrap();
        assert!(output.status.success(), "{words:?}: {}", String::from_utf8_lossy(&output.stderr));
    }

    /// Runs a command under the tracer.
    pub(crate) fn trace(&self, words: &[String], fault: Option<(usize, Fault)>) -> Outcome {
        run(&mut command(self.folder.path(), words), self.folder.path(), fault).unwrap()
    }

    /// The files below a folder. Unfinished ones are allowed where `killed`.
    fn files(&self, folder: &str, killed: bool) -> Files {
        let mut files = Files::new();
        let mut open = vec![self.path(folder)];
        while let Some(folder) = open.pop() {
            let Ok(listing) = folder.read_dir() else { continue };
            for path in listing.map(|entry| entry.unwrap().path()) {
                let name = path.file_name().unwrap().to_string_lossy().into_owned();
                if path.is_dir() {
                    open.push(path);
                } else if name.starts_with(".ivd-unfinished-") {
                    assert!(killed, "{}: an unfinished file was left: {}", self.name, path.display());
                } else if name == ".ivd-run.json" {
                    // It tells what the run did, which a fault changes; it must be whole.
                    let text = std::fs::read_to_string(&path).unwrap();
                    serde_json::from_str::<serde_json::Value>(&text).unwrap();
                } else {
                    let bytes = std::fs::read(&path).unwrap();
                    files.insert(path, bytes);
                }
            }
        }
        files
    }

    /// Puts the output folder back as it was, and forgets the cache.
    fn restore(&self, outputs: &Files) {
        for folder in ["out", "cache"] {
            let _ = std::fs::remove_dir_all(self.path(folder));
        }
        std::fs::create_dir(self.path("out")).unwrap();
        for (path, bytes) in outputs {
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, bytes).unwrap();
        }
    }

    /// Runs the command with every fault at every operation, of two faults one after the other in turn unless `IVD_STRESS_EVERY` is 1. Outputs must be old, new or absent each; the run after
    /// it, without a fault, must give what a run without any gives.
    pub(crate) fn try_all(&self, words: &[String], faults: &[Fault]) -> Verdict {
        self.try_where(words, faults, if faults.len() == 2 { every(2) } else { 1 }, |_| true)
    }

    /// As [`Job::try_all`], at writes alone.
    pub(crate) fn try_writes(&self, words: &[String], faults: &[Fault]) -> Verdict {
        self.try_where(words, faults, 1, |operation| operation.what == "write" && operation.bytes > 1)
    }

    fn try_where(
        &self,
        words: &[String],
        faults: &[Fault],
        every: usize,
        at: impl Fn(&Operation) -> bool,
    ) -> Verdict {
        let old = self.files("out", false);
        self.restore(&old);
        let plain = self.trace(words, None);
        assert_eq!(plain.code, Some(0), "{}: {}", self.name, plain.stderr);
        let new = self.files("out", false);
        let mut verdict = Verdict::default();
        for (n, operation) in plain.operations.iter().enumerate().filter(|(_, operation)| at(operation)) {
            for (_, &fault) in faults.iter().enumerate().filter(|(of, _)| (n + of) % every == 0) {
                self.restore(&old);
                let case = format!("{}: {fault:?} at {} of {operation:?}", self.name, n + 1);
                let outcome = self.trace(words, Some((n + 1, fault)));
                assert!(outcome.operations.len() > n, "{case}: the run made other operations");
                self.judge(&case, fault, operation, &outcome, (&old, &new), &mut verdict);
                self.must(words);
                assert!(self.files("out", false) == new, "{case}: the next run gave something else");
                self.files("cache", fault == Fault::Kill);
            }
        }
        self.restore(&old);
        println!("{}: {} operations, {verdict:?}", self.name, plain.operations.len());
        verdict
    }

    fn judge(
        &self,
        case: &str,
        fault: Fault,
        operation: &Operation,
        outcome: &Outcome,
        (old, new): (&Files, &Files),
        verdict: &mut Verdict,
    ) {
        verdict.runs += 1;
        let found = self.files("out", fault == Fault::Kill);
        for (path, bytes) in &found {
            let known = [old.get(path), new.get(path)].contains(&Some(bytes));
            assert!(known, "{case}: {} is neither old nor new", path.display());
        }
        assert!(old.keys().all(|path| found.contains_key(path)), "{case}: an old output is gone");
        verdict.untouched += usize::from(found == *old);
        verdict.replaced += usize::from(found == *new);
        let retried = fault == Fault::Short || fault == Fault::Error(4);
        match outcome.code {
            None => {
                assert!(fault == Fault::Kill, "{case}: a signal ended it");
                verdict.killed += 1;
            }
            Some(0) => {
                let cached =
                    operation.path.starts_with(self.path("cache").canonicalize().unwrap_or_default());
                assert!(retried || cached || found == *new, "{case}: a lost output was called success");
                assert!(found == *new, "{case}: success without the new outputs");
                verdict.uncached += usize::from(cached && !retried);
            }
            Some(7) => {
                assert!(!retried, "{case}: not tried again: {}", outcome.stderr);
                assert!(
                    outcome.stderr.starts_with("ivd: ") && outcome.stderr.len() > 20,
                    "{case}: {}",
                    outcome.stderr
                );
                verdict.refused += 1;
            }
            Some(other) => panic!("{case}: exit code {other}: {}", outcome.stderr),
        }
    }

    /// As [`Job::try_all`] for a command whose outputs differ from run to run: each must be whole.
    pub(crate) fn try_whole(
        &self,
        words: &[String],
        faults: &[Fault],
        whole: &dyn Fn(&str, &[u8]) -> bool,
    ) -> Verdict {
        let old = self.files("out", false);
        self.restore(&old);
        let plain = self.trace(words, None);
        assert_eq!(plain.code, Some(0), "{}: {}", self.name, plain.stderr);
        let mut verdict = Verdict::default();
        for (n, operation) in plain.operations.iter().enumerate() {
            for &fault in faults {
                self.restore(&old);
                let case = format!("{}: {fault:?} at {} of {operation:?}", self.name, n + 1);
                let outcome = self.trace(words, Some((n + 1, fault)));
                let found = self.files("out", fault == Fault::Kill);
                assert_eq!(found.len(), old.len(), "{case}: {found:?}");
                for (path, bytes) in &found {
                    let name = path.file_name().unwrap().to_string_lossy();
                    assert!(whole(&name, bytes), "{case}: {name} is half written");
                }
                assert!(
                    matches!(outcome.code, None | Some(7)),
                    "{case}: {:?} {}",
                    outcome.code,
                    outcome.stderr
                );
                verdict.runs += 1;
                verdict.killed += usize::from(outcome.code.is_none());
                verdict.refused += usize::from(outcome.code == Some(7));
            }
        }
        self.must(words);
        println!("{}: {} operations, {verdict:?}", self.name, plain.operations.len());
        verdict
    }
}
