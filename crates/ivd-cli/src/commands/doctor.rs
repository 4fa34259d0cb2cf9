//! `ivd doctor`: what this machine offers and what is switched off.

use serde_json::{Value, json};

use crate::context::Context;
use crate::gpu::{self, Examined};

/// Tells it.
pub(super) fn run(context: &Context) -> anyhow::Result<()> {
    let simd = simd();
    let memory = total_memory();
    let cache = ivd_artefact::user_cache();
    let graphics = gpu::examine();
    let off = match &graphics.usable {
        Ok((_, kernels)) => {
            json!({ "what": "gpu", "unless": "--backend gpu", "why": gpu::AUTO, "kernels": kernels })
        }
        Err(why) => json!({ "what": "gpu", "why": why }),
    };
    let object = json!({
        "version": env!("CARGO_PKG_VERSION"),
        "threads": context.exec.threads(),
        "processors": std::thread::available_parallelism().map_or(1, std::num::NonZero::get),
        "memory_bytes": memory,
        "simd": simd,
        "adapter": graphics.usable.as_ref().ok().map(|(adapter, _)| adapter),
        "adapters": graphics.adapters,
        "switched_off": [off],
        "cache": cache,
    });
    context.print(&object, || {
        let memory = memory
            .map_or_else(|| "unknown".to_owned(), |b| format!("{:.1} GiB", b as f64 / f64::from(1 << 30)));
        let cache = cache.map_or_else(|| "off (no home folder)".to_owned(), |c| c.display().to_string());
        format!(
            "ivd {}\nthreads     {}\nmemory      {memory}\nSIMD        {}\n{}\ncache       {cache}",
            env!("CARGO_PKG_VERSION"),
            context.exec.threads(),
            if simd.is_empty() { "baseline".to_owned() } else { simd.join(" ") },
            told(&graphics),
        )
    })
}

/// A line for each adapter, and what uses them.
fn told(graphics: &Examined) -> String {
    let text = |adapter: &Value, key: &str| adapter[key].as_str().unwrap_or_default().to_owned();
    let line = |adapter: &Value| {
        let [name, kind, api, driver] = ["name", "kind", "api", "driver"].map(|key| text(adapter, key));
        let binding = adapter["max_binding_bytes"].as_u64().unwrap_or(0) >> 20;
        let flags = adapter["features"].as_object().into_iter().flatten();
        let flags: Vec<String> = flags
            .map(|(name, there)| if there == true { name.clone() } else { format!("no {name}") })
            .collect();
        let software = if kind == "cpu" { ", software: slower than the CPU's own code" } else { "" };
        format!(
            "GPU         {name} ({kind}, {api}, {driver}; a volume of up to {binding} MiB; {}){software}",
            flags.join(", ")
        )
    };
    let mut lines: Vec<String> = graphics.adapters.iter().map(line).collect();
    lines.push(match &graphics.usable {
        Ok((adapter, kernels)) => {
            format!(
                "            {} is used with --backend gpu, for {}",
                text(adapter, "name"),
                kernels.join(", ")
            )
        }
        Err(why) => format!("GPU         off: {why}; the CPU does the work"),
    });
    lines.join("\n")
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
