/// The triangles round each vertex, in one flat table: the star of vertex `v` is `of(v)`, ascending.
#[derive(Debug, Default)]
pub(crate) struct Stars {
    starts: Vec<u32>,
    triangles: Vec<u32>,
}

impl Stars {
    /// Stars of `vertex_count` vertices, by a counting sort of the corners. A triangle that names a vertex twice is
    /// in its star twice.
    pub(crate) fn new(vertex_count: usize, triangles: &[[u32; 3]]) -> Self {
        let mut stars = Self::default();
        stars.rebuild(vertex_count, triangles.len(), |t| triangles[t]);
        stars
    }

    /// The same, reusing the memory; `corners` tells those of a triangle.
    pub(crate) fn rebuild(
        &mut self,
        vertex_count: usize,
        triangle_count: usize,
        corners: impl Fn(usize) -> [u32; 3],
    ) {
        self.starts.clear();
        self.starts.resize(vertex_count + 1, 0);
        for t in 0..triangle_count {
            for v in corners(t) {
                self.starts[v as usize] += 1;
            }
        }
        let mut sum = 0;
        for start in &mut self.starts {
            sum += *start;
            *start = sum;
        }
        self.triangles.clear();
        self.triangles.resize(triangle_count * 3, 0);
        // Each start counts down from its star's end; going backwards leaves the stars ascending.
        for t in (0..triangle_count).rev() {
            for v in corners(t) {
                let slot = &mut self.starts[v as usize];
                *slot -= 1;
                self.triangles[*slot as usize] = t as u32;
            }
        }
    }

    /// Triangles round vertex `v`.
    #[inline]
    pub(crate) fn of(&self, v: usize) -> &[u32] {
        &self.triangles[self.starts[v] as usize..self.starts[v + 1] as usize]
    }

    /// Number of vertices.
    pub(crate) fn len(&self) -> usize {
        self.starts.len().saturating_sub(1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stars_list_each_vertex_own_triangles_ascending() {
        let stars = Stars::new(5, &[[0, 1, 2], [2, 1, 3], [0, 2, 3]]);
        assert_eq!(stars.len(), 5);
        assert_eq!((stars.of(0), stars.of(1), stars.of(2)), (&[0, 2][..], &[0, 1][..], &[0, 1, 2][..]));
        assert!(stars.of(4).is_empty());
    }
}
