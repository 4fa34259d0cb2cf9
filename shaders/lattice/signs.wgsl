// Reads the signs of the stored values: signs.rs. A lane a word.
//#include lattice/words.wgsl

@group(0) @binding(2) var<storage, read> volume: array<u32>;
@group(0) @binding(3) var<storage, read_write> signs: array<u32>;

//#include shared/stored.wgsl

fn each(w: u32) {
    if (w < all_words()) {
        let row = w / params.words;
        let y = row % params.rows;
        let z = row / params.rows;
        // Bit b is padded voxel x + b, which is the one before it of the row; those from `end` on aren't in the row.
        let n = params.width - 2u;
        let x = 32u * (w % params.words);
        let end = min(32u, max(n + 1u, x) - x);
        var word = 0u;
        if (end > 0u && y > 0u && y + 1u < params.rows && z > 0u && z + 1u < params.layers) {
            let stored = words_from(n * (y - 1u + (params.rows - 2u) * (z - 1u)) + x - 1u);
            var values = volume[stored.first];
            for (var j = 0u; j < 32u / IN_A_WORD; j++) {
                let next = volume[stored.first + j + 1u];
                let here = joined(values, next, stored.bit);
                values = next;
                for (var i = 0u; i < IN_A_WORD; i++) {
                    let r = rank_in(here, i);
                    word |= select(0u, 1u, r >= params.first && r <= params.last) << (IN_A_WORD * j + i);
                }
            }
            word &= select((1u << end) - 1u, 0xffffffffu, end == 32u);
            word &= select(0xffffffffu, 0xfffffffeu, x == 0u);
        }
        signs[w] = word;
    }
}
