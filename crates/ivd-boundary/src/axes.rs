//! The axes that a volume has: one of a single voxel is none, so that a volume of one slice is a plane.

/// Edges of a voxel along the axes of more than one voxel; along all three where there is no such axis.
pub(crate) fn edges_along_axes(dims: [usize; 3], edges: [f64; 3]) -> impl Iterator<Item = f64> + Clone {
    let is_point = dims == [1; 3];
    (0..3).filter(move |&a| is_point || dims[a] > 1).map(move |a| edges[a])
}

/// Edge of the cube, or square, of a voxel's volume, or area, along the axes of more than one voxel.
pub(crate) fn mean_edge(dims: [usize; 3], edges: [f64; 3]) -> f64 {
    let present = edges_along_axes(dims, edges);
    let product: f64 = present.clone().product();
    match present.count() {
        1 => product,
        2 => product.sqrt(),
        _ => product.cbrt(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_axis_of_one_voxel_does_not_count() {
        let edges = [0.5, 2.0, 27.0];
        assert!((mean_edge([4, 4, 4], edges) - 3.0).abs() < 1e-12);
        assert!((mean_edge([4, 4, 1], edges) - 1.0).abs() < 1e-12);
        assert!((mean_edge([1, 4, 1], edges) - 2.0).abs() < 1e-12);
        assert!((mean_edge([1, 1, 1], edges) - 3.0).abs() < 1e-12);
    }
}
