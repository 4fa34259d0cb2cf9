/// Voxels of one interval of stored values.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Group {
    /// Smallest and largest stored value.
    pub(crate) range: [f64; 2],
    pub(crate) count: u64,
    /// Mean of the stored values.
    pub(crate) mean: f64,
    /// Standard deviation of the stored values.
    pub(crate) sd: f64,
    /// Sum of squared deviations from the mean, stored units².
    pub(crate) inertia: f64,
}

/// A partition of the stored values into intervals, ascending; none is empty.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Partition {
    pub(crate) groups: Vec<Group>,
    /// Certified excess of the inertia over the optimum, stored units².
    pub(crate) gap: f64,
    pub(crate) iterations: u64,
    pub(crate) converged: bool,
}

impl Partition {
    /// The partition of no values.
    pub(crate) fn empty() -> Self {
        Self { groups: Vec::new(), gap: 0.0, iterations: 0, converged: true }
    }

    /// Smallest stored value of every group but the first: a value belongs to the group with as many cuts at or below it.
    pub(crate) fn cuts(&self) -> Vec<f64> {
        self.groups.iter().skip(1).map(|g| g.range[0]).collect()
    }

    pub(crate) fn inertia(&self) -> f64 {
        self.groups.iter().map(|g| g.inertia).sum()
    }
}
