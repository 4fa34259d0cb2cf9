//! `ivd cache`.

use ivd_core::counted;
use serde_json::json;

use crate::args::CacheAction;
use crate::context::Context;

/// Shows, prunes or clears.
pub(super) fn run(action: Option<CacheAction>, context: &Context) -> anyhow::Result<()> {
    let cache = context.pipeline_cache()?;
    let folder = cache.folder().map(std::path::Path::to_owned);
    match action.unwrap_or(CacheAction::Show) {
        CacheAction::Show => {
            let entries = cache.entries()?;
            let bytes: u64 = entries.iter().map(|e| e.bytes).sum();
            let rows: Vec<_> = entries
                .iter()
                .map(|e| json!({ "path": e.path, "stage": e.info.as_ref().map(|i| &i.provenance.stage), "kind": e.info.as_ref().map(|i| i.kind.name()), "bytes": e.bytes }))
                .collect();
            let object = json!({ "folder": folder, "bytes": bytes, "entries": rows });
            context.print(&object, || {
                let place = folder.map_or_else(|| "off".to_owned(), |f| f.display().to_string());
                let count = counted(entries.len(), "entry", "entries");
                format!("{place}\n{count}, {:.1} MiB", bytes as f64 / f64::from(1 << 20))
            })
        }
        CacheAction::Prune { keep } => freed(cache.prune(keep)?, context),
        CacheAction::Clear => freed(cache.clear()?, context),
    }
}

fn freed(bytes: u64, context: &Context) -> anyhow::Result<()> {
    context.print(&json!({ "freed_bytes": bytes }), || {
        format!("freed {:.1} MiB", bytes as f64 / f64::from(1 << 20))
    })
}
