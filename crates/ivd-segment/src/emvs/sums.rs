use super::mixture::AXES;

/// Sums of a component: responsibility, and with it the deviations from the present mean and their products (upper triangle).
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Sums {
    pub(super) n: f64,
    pub(super) d: [f64; AXES],
    pub(super) dd: [[f64; AXES]; AXES],
}

impl Sums {
    pub(super) fn join(&mut self, other: &Self) {
        self.n += other.n;
        self.d.iter_mut().zip(other.d).for_each(|(sum, v)| *sum += v);
        self.dd.iter_mut().flatten().zip(other.dd.as_flattened()).for_each(|(sum, v)| *sum += v);
    }
}
