// One table, in three parts: of each case of signs CASE_WORDS words (how many triangles, or OPEN where the signs leave that open; their corners, four bits
// each); of each crossing of an open cell a word (how many triangles, above it where they begin); the corners of those, four bits each.
const CASE_WORDS = 4u;
const OPEN = 0x100u;
const CROSSINGS_AT = 256u * CASE_WORDS;
const TRIANGLES_AT = CROSSINGS_AT + 1024u;
