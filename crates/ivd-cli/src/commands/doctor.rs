//! `ivd doctor`: what this machine offers and what is switched off.

use serde_json::json;

use crate::context::{Context, user_cache};

/// Tells it.
pub(super) fn run(context: &Context) -> anyhow::Result<()> {
    let simd = simd();
    let memory = total_memory();
    let cache = user_cache();
    let object = json!({
        "version": env!("CARGO_PKG_VERSION"),
        "threads": context.exec.threads(),
        "processors": std::thread::available_parallelism().map_or(1, std::num::NonZero::get),
        "memory_bytes": memory,
        "simd": simd,
        "adapter": null,
        "switched_off": [{ "what": "gpu", "why": "this build has no GPU backend; the CPU does the work" }],
        "cache": cache,
    });
    context.print(&object, || {
        let memory = memory.map_or_else(|| "unknown".to_owned(), |b| format!("{:.1} GiB", b as f64 / f64::from(1 << 30)));
        let cache = cache.map_or_else(|| "off (no home folder)".to_owned(), |c| c.display().to_string());
        format!(
            "ivd {}\nthreads     {}\nmemory      {memory}\nSIMD        {}\nGPU         off: this build has no GPU backend; the CPU does the work\ncache       {cache}",
            env!("CARGO_PKG_VERSION"),
            context.exec.threads(),
            if simd.is_empty() { "baseline".to_owned() } else { simd.join(" ") },
        )
    })
}

#[cfg(target_arch = "x86_64")]
fn simd() -> Vec<&'static str> {
    let found = [
        ("sse4.2", std::arch::is_x86_feature_detected!("sse4.2")),
        ("avx2", std::arch::is_x86_feature_detected!("avx2")),
        ("fma", std::arch::is_x86_feature_detected!("fma")),
        ("avx512f", std::arch::is_x86_feature_detected!("avx512f")),
    ];
    found.into_iter().filter(|(_, here)| *here).map(|(name, _)| name).collect()
}

#[cfg(target_arch = "aarch64")]
fn simd() -> Vec<&'static str> {
    vec!["neon"]
}

#[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
fn simd() -> Vec<&'static str> {
    Vec::new()
}

/// Bytes of memory, where the system tells.
fn total_memory() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/meminfo").ok()?;
    let line = text.lines().find_map(|l| l.strip_prefix("MemTotal:"))?;
    line.split_whitespace().next()?.parse::<u64>().ok().map(|kib| kib * 1024)
}
