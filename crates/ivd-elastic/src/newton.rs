//! Newton's method on the energy, with a line search that keeps J > 0.

use ivd_core::{Error, Exec};

use crate::conjugate;
use crate::system::Body;
use crate::tangent::Tangent;
use crate::vectors::{Triple, add, dot};

/// Part of the promised decrease that a step has to make (Armijo).
const DECREASE: f64 = 1e-4;
/// Halvings of a step before it is given up.
const HALVINGS: u32 = 30;
/// Steps by the bounded derivative after one that met a direction in which the energy bends down.
const WARY: u32 = 3;
/// What is left of the forces where the second derivative itself is tried: farther off it mostly bends down somewhere.
const NEAR: f64 = 0.1;
/// Iterations of the equations of one step.
const ITERATIONS: u32 = 1000;

/// How near to equilibrium a body came.
#[derive(Debug, Clone, Copy, Default)]
pub struct Balance {
    /// Iterations of conjugate gradients.
    pub iterations: u32,
    /// Steps of Newton's method.
    pub steps: u32,
    /// What is left of the forces, relative to what they cancel, each weighed by how far it would move its node.
    pub residual: f64,
    /// Whether that is what was asked for.
    pub reached: bool,
}

impl Body {
    /// Bytes that it takes to find its balance.
    pub fn bytes(&self) -> u64 {
        // Some dozen vectors of the nodes' values.
        (self.mesh.cells.len() * Tangent::bytes() + 12 * size_of::<Triple>() * self.mesh.nodes.len()) as u64
    }

    /// Moves the free nodes until the forces that are left are `tolerance` of those that cancel, in at most `limit` steps.
    ///
    /// Before each step of all nodes of a guarded body those whose forces stand out are moved by themselves.
    ///
    /// The field given has J > 0 at every Gauss point, and so has what becomes of it; where it hasn't, nothing is done.
    ///
    /// # Errors
    /// Cancelled.
    pub fn balance(
        &self,
        u: &mut Vec<Triple>,
        tolerance: f64,
        limit: u32,
        exec: &Exec,
    ) -> Result<Balance, Error> {
        let mut balance = Balance::default();
        let Some(mut now) = self.energy(u) else { return Ok(balance) };
        let (mut before, mut wary) = (0.0, 0);
        loop {
            let mut forces = self.forces(u);
            if self.element.is_guarded() && self.relax_worst(u, &mut forces, tolerance, exec)? {
                now = self.energy(u).expect("single nodes keep J > 0");
            }
            let (left_mm, cancelled_mm) = (forces.left_mm(), forces.cancelled_mm);
            let gradient = forces.left;
            balance.residual = if cancelled_mm > 0.0 { left_mm / cancelled_mm } else { 0.0 };
            balance.reached = balance.residual <= tolerance;
            if balance.reached || balance.steps == limit {
                return Ok(balance);
            }
            let downhill: Vec<Triple> = gradient.iter().map(|g| g.map(|c| -c)).collect();
            // Loose while far away, so that the last steps still gain digits as Newton's do (Eisenstat & Walker 1996).
            let forcing = (left_mm / before).powi(2).clamp(1e-4, 0.1).max(0.5 * tolerance / balance.residual);
            let solve = |bounded: bool| {
                let tangent = Tangent::new(self, u, bounded, exec)?;
                conjugate::solve(&tangent, &downhill, forcing.min(0.1), ITERATIONS, exec)
            };
            let exact = !self.element.is_guarded() || (wary == 0 && balance.residual < NEAR);
            let mut found = solve(!exact)?;
            balance.iterations += found.iterations;
            wary = u32::saturating_sub(wary, 1);
            if exact && found.indefinite && self.element.is_guarded() {
                // Where the energy bends down, what it bends up at most leads on sooner than what was found by then.
                found = solve(true)?;
                balance.iterations += found.iterations;
                wary = WARY;
            }
            balance.steps += 1;
            before = left_mm;
            let slope = dot(&gradient, &found.values);
            let Some((next, energy)) = self.search(u, &found.values, slope, now) else { return Ok(balance) };
            (*u, now) = (next, energy);
        }
    }

    /// The longest of halved steps that has J > 0 and makes the energy less, up to rounding.
    fn search(
        &self,
        u: &[Triple],
        way: &[Triple],
        slope: f64,
        now: (f64, f64),
    ) -> Option<(Vec<Triple>, (f64, f64))> {
        let mut step = 1.0;
        for _ in 0..HALVINGS {
            let mut next = u.to_vec();
            add(&mut next, way, step);
            if let Some(found) = self.energy(&next)
                && is_less(found.0, now, step * slope)
            {
                return Some((next, found));
            }
            step /= 2.0;
        }
        None
    }
}

/// Whether an energy is less than another, whose terms have a size, by enough of what the slope promised; up to rounding.
pub(crate) fn is_less(next: f64, (now, size): (f64, f64), promised: f64) -> bool {
    next <= now + DECREASE * promised + 1e-14 * size
}
