use std::sync::OnceLock;
use std::time::Instant;

/// A graphics processor, or a program that plays one.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Adapter {
    /// Its name, as its driver says it.
    pub name: String,
    /// Driver and version.
    pub driver: String,
    /// What it is spoken to through: `vulkan`, `metal`, `dx12`.
    pub api: String,
    /// `discrete`, `integrated`, `virtual`, `cpu` (software) or `other`.
    pub kind: &'static str,
    /// Largest binding of a buffer (bytes).
    pub max_binding: u64,
    /// Largest buffer (bytes).
    pub max_buffer: u64,
    /// Optional features that kernels here use, and whether they are there.
    pub features: Vec<(&'static str, bool)>,
}

impl Adapter {
    /// Whether it is software: slower than the processor's own code.
    pub fn is_software(&self) -> bool {
        self.kind == "cpu"
    }
}

/// Optional features that kernels here use.
pub(crate) const FEATURES: [(&str, wgpu::Features); 3] = [
    ("f64", wgpu::Features::SHADER_F64),
    ("int64", wgpu::Features::SHADER_INT64),
    ("timestamps", wgpu::Features::TIMESTAMP_QUERY),
];

/// Which adapter is meant.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub enum Choice {
    /// The fastest kind there is, software last.
    #[default]
    Best,
    /// The first whose name or kind holds this text, in any case of letters.
    Named(String),
    /// None, whatever there is.
    None,
}

impl Choice {
    /// What the variable `IVD_ADAPTER` says, `none` for none at all; the best where it isn't set.
    pub fn from_env() -> Self {
        match std::env::var("IVD_ADAPTER") {
            Ok(name) if name.eq_ignore_ascii_case("none") => Self::None,
            Ok(name) if !name.is_empty() => Self::Named(name),
            _ => Self::Best,
        }
    }
}

/// Why no adapter could be opened.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum OpenError {
    /// There is none.
    #[error("no GPU was found: {0}")]
    None(String),
    /// None of those there are is meant.
    #[error("no GPU is called `{asked}`; there are {there}")]
    NotNamed {
        /// What was asked for.
        asked: String,
        /// Those there are.
        there: String,
    },
    /// It could not be opened.
    #[error("{adapter} could not be opened: {problem}")]
    Refused {
        /// Its name.
        adapter: String,
        /// What its driver says.
        problem: String,
    },
}

/// What drivers are reached through, one for the whole process: some can't be loaded again and again.
fn instance() -> &'static wgpu::Instance {
    static INSTANCE: OnceLock<wgpu::Instance> = OnceLock::new();
    INSTANCE.get_or_init(opened)
}

fn opened() -> wgpu::Instance {
    let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
    descriptor.backends = wgpu::Backends::VULKAN | wgpu::Backends::METAL | wgpu::Backends::DX12;
    // No layers for debugging, and no drivers that fail the tests of conformance.
    descriptor.flags = wgpu::InstanceFlags::empty();
    wgpu::Instance::new(descriptor)
}

/// The adapters that there are, the fastest kind first; none where `IVD_ADAPTER` says so.
pub fn adapters() -> Vec<Adapter> {
    if Choice::from_env() == Choice::None {
        return Vec::new();
    }
    found().iter().map(describe).collect()
}

fn found() -> Vec<wgpu::Adapter> {
    let start = Instant::now();
    let mut found = pollster::block_on(instance().enumerate_adapters(wgpu::Backends::all()));
    found.sort_by_key(|adapter| rank(adapter.get_info().device_type));
    tracing::debug!(adapters = found.len(), ms = start.elapsed().as_millis() as u64, "adapters looked for");
    found
}

fn rank(kind: wgpu::DeviceType) -> u8 {
    match kind {
        wgpu::DeviceType::DiscreteGpu => 0,
        wgpu::DeviceType::IntegratedGpu => 1,
        wgpu::DeviceType::VirtualGpu => 2,
        wgpu::DeviceType::Other => 3,
        wgpu::DeviceType::Cpu => 4,
    }
}

pub(crate) fn describe(adapter: &wgpu::Adapter) -> Adapter {
    let (info, limits, features) = (adapter.get_info(), adapter.limits(), adapter.features());
    Adapter {
        name: info.name,
        driver: [info.driver, info.driver_info].join(" ").trim().to_owned(),
        api: info.backend.to_string(),
        kind: ["discrete", "integrated", "virtual", "other", "cpu"][usize::from(rank(info.device_type))],
        max_binding: limits.max_storage_buffer_binding_size,
        max_buffer: limits.max_buffer_size,
        features: FEATURES.iter().map(|(name, feature)| (*name, features.contains(*feature))).collect(),
    }
}

/// The adapter that is meant.
pub(crate) fn choose(choice: &Choice) -> Result<wgpu::Adapter, OpenError> {
    if *choice == Choice::None {
        return Err(OpenError::None("IVD_ADAPTER says that none is to be used".to_owned()));
    }
    let mut found = found();
    if found.is_empty() {
        return Err(OpenError::None(why_none()));
    }
    let Choice::Named(asked) = choice else { return Ok(found.swap_remove(0)) };
    let described: Vec<Adapter> = found.iter().map(describe).collect();
    let word = asked.to_lowercase();
    let is_meant = |adapter: &Adapter| adapter.name.to_lowercase().contains(&word) || adapter.kind == word;
    if let Some(meant) = described.iter().position(is_meant) {
        return Ok(found.swap_remove(meant));
    }
    let there: Vec<String> = described.iter().map(|a| format!("{} ({})", a.name, a.kind)).collect();
    Err(OpenError::NotNamed { asked: asked.clone(), there: there.join(", ") })
}

/// What the drivers say where there is no adapter.
fn why_none() -> String {
    let asked = instance().request_adapter(&wgpu::RequestAdapterOptions::default());
    match pollster::block_on(asked) {
        Ok(_) => "its driver comes and goes; try again".to_owned(),
        Err(error) => format!("{error}; install a driver for Vulkan, Metal or Direct3D 12"),
    }
}
