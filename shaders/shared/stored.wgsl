// The stored voxels as ranks: whole numbers that ascend with their values. Comparing them is exact on every device, which floats are not where one takes
// small numbers for 0.

fn rank_of_float(word: u32) -> u32 {
    // −0 is 0.
    let bits = select(word, 0u, word == 0x80000000u);
    return select(bits | 0x80000000u, ~bits, (bits & 0x80000000u) != 0u);
}

// Whether a rank is that of a number: neither infinite nor none.
fn is_number(rank: u32) -> bool {
//#if F32
    return rank > 0x007fffffu && rank < 0xff800000u;
//#else
    return true;
//#end
}

// Two words from a bit on.
fn joined(low: u32, high: u32, bit: u32) -> u32 {
    return select(low >> bit | high << (32u - bit), low, bit == 0u);
}

// What is stored in words whose voxels begin at any place: word `j` of those from a start on.
struct Words {
    first: u32, // the word of the first voxel; one before the first of all is the greatest number there is
    bit: u32,   // where in it that voxel begins
}

//#if BYTES
const IN_A_WORD = 4u;
//#else
//#if HALVES
const IN_A_WORD = 2u;
//#else
const IN_A_WORD = 1u;
//#end
//#end

// From voxel `start` on, which may be the one before the first.
fn words_from(start: u32) -> Words {
    let first = select(start / IN_A_WORD, 0xffffffffu, start == 0xffffffffu);
    return Words(first, (start % IN_A_WORD) * (32u / IN_A_WORD));
}

fn word_of(words: Words, j: u32) -> u32 {
//#if F32
    return volume[words.first + j];
//#else
    return joined(volume[words.first + j], volume[words.first + j + 1u], words.bit);
//#end
}

// Rank of voxel `i` of a word.
fn rank_in(word: u32, i: u32) -> u32 {
//#if U8
    return (word >> (8u * i)) & 0xffu;
//#end
//#if I8
    return ((word >> (8u * i)) & 0xffu) ^ 0x80u;
//#end
//#if U16
    return (word >> (16u * i)) & 0xffffu;
//#end
//#if I16
    return ((word >> (16u * i)) & 0xffffu) ^ 0x8000u;
//#end
//#if F32
    return rank_of_float(word);
//#end
}

// Of the four voxels from 4 q on.
fn ranks(q: u32) -> vec4<u32> {
//#if BYTES
    let word = volume[q];
    return vec4<u32>(rank_in(word, 0u), rank_in(word, 1u), rank_in(word, 2u), rank_in(word, 3u));
//#end
//#if HALVES
    let two = vec2<u32>(volume[2u * q], volume[2u * q + 1u]);
    return vec4<u32>(rank_in(two.x, 0u), rank_in(two.x, 1u), rank_in(two.y, 0u), rank_in(two.y, 1u));
//#end
//#if F32
    let q4 = 4u * q;
    return vec4<u32>(rank_in(volume[q4], 0u), rank_in(volume[q4 + 1u], 0u), rank_in(volume[q4 + 2u], 0u), rank_in(volume[q4 + 3u], 0u));
//#end
}
