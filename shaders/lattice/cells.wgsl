// What words of signs say of the cells and edges that begin in them: rows.rs.

@group(0) @binding(2) var<storage, read> signs: array<u32>;

// Whether cells begin in a word: not in the last word of a row, the last row of a layer, or the last layer.
fn has_cells(w: u32) -> bool {
    let row = w / params.words;
    return w < all_words() && w % params.words + 1u < params.words && row % params.rows + 1u < params.rows && row / params.rows + 1u < params.layers;
}

fn above(w: u32) -> u32 {
    return w + params.words * params.rows;
}

// Beyond the last layer all is outside.
fn sign(w: u32) -> u32 {
    return select(0u, signs[min(w, all_words() - 1u)], w < all_words());
}

// For each axis a bit for each voxel of a word that starts a crossed edge.
fn crossed(w: u32) -> vec3<u32> {
    let here = signs[w];
    let next = here >> 1u | sign(w + 1u) << 31u;
    return vec3<u32>(here) ^ vec3<u32>(next, sign(w + params.words), sign(above(w)));
}

// The words at the corners of a word's cells, in the order of corners, and those one voxel on.
struct Corners {
    low: vec4<u32>,
    high: vec4<u32>,
}

fn corners_of(w: u32) -> Corners {
    let at = vec4<u32>(w, w + params.words, above(w), above(w) + params.words);
    let low = vec4<u32>(signs[at.x], signs[at.y], signs[at.z], signs[at.w]);
    let next = vec4<u32>(signs[at.x + 1u], signs[at.y + 1u], signs[at.z + 1u], signs[at.w + 1u]);
    return Corners(low, low >> vec4<u32>(1u) | next << vec4<u32>(31u));
}

// The cells with corners of both signs.
fn active_of(c: Corners) -> u32 {
    let either = c.low | c.high;
    let both = c.low & c.high;
    return (either.x | either.y | either.z | either.w) & ~(both.x & both.y & both.z & both.w);
}

// The signs of a cell's corners.
fn case_of(c: Corners, bit: u32) -> u32 {
    let pair = (c.low >> vec4<u32>(bit) & vec4<u32>(1u)) | (c.high >> vec4<u32>(bit) & vec4<u32>(1u)) << vec4<u32>(1u);
    return pair.x | pair.y << 2u | pair.z << 4u | pair.w << 6u;
}
