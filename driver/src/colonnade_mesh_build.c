/* SPDX-License-Identifier: Apache-2.0 */
/* Builds trees over meshes of a target's own: docs/driver.md. */
#include "colonnade_integers.h"
#include "colonnade_mesh_parts.h"

enum { CODE_BITS = 10, DIGIT_BITS = 8, DIGITS = 1 << DIGIT_BITS, MOST_RANGES = 256, MOST_NEIGHBOURS = 32 };

/* The box of a leaf's vertices. */
static void bounds(const struct colonnade_vertex *vertices, const uint32_t of[4], int32_t low[3], int32_t high[3]) {
    const int count = of[3] == UINT32_MAX ? 3 : 4;
    for (int axis = 0; axis < 3; ++axis) {
        low[axis] = high[axis] = vertices[of[0]].position[axis];
        for (int i = 1; i < count; ++i) {
            const int32_t at = vertices[of[i]].position[axis];
            if (at < low[axis]) low[axis] = at;
            if (at > high[axis]) high[axis] = at;
        }
    }
}

/* Whether a pair's deltas fit. */
static bool is_near(const struct colonnade_mesh *mesh, const int32_t low[3], const int32_t high[3]) {
    return ((high[0] - low[0]) | (high[1] - low[1]) | (high[2] - low[2])) >> mesh->delta_bits == 0;
}

/* The vertex at which an edge begins, or with `end` 1 ends; the number of an edge is 3 * triangle + corner. */
static uint32_t at_edge(const struct colonnade_triangle *triangles, uint32_t edge, uint32_t end) {
    return triangles[edge / 3].vertices[(edge % 3 + end) % 3];
}

/* Makes places in a sorted list of the counts of its keys. */
static void to_places(uint32_t *counts, uint32_t keys) {
    for (uint32_t i = 0, sum = 0; i < keys; ++i) {
        const uint32_t own = counts[i];
        counts[i] = sum;
        sum += own;
    }
}

/* Sorts edges by the vertex at which they begin, then that at which they end, then their number. Answers in `ends`
 * where the edges of each first vertex end. Vertices of `leaves` are memory meanwhile. */
static void sort_edges(const struct colonnade_triangle *triangles, uint32_t count, uint32_t *ends,
                       uint32_t vertex_count, uint32_t *sorted, struct colonnade_leaf *leaves) {
    for (uint32_t end = 2; end-- > 0;) {
        for (uint32_t i = 0; i < vertex_count; ++i) ends[i] = 0;
        for (uint32_t i = 0; i < 3 * count; ++i) ++ends[at_edge(triangles, i, end)];
        to_places(ends, vertex_count);
        for (uint32_t i = 0; i < 3 * count; ++i) {
            const uint32_t edge = end == 1 ? i : leaves[i / 3].vertices[i % 3],
                           place = ends[at_edge(triangles, edge, end)]++;
            if (end == 1) leaves[place / 3].vertices[place % 3] = edge;
            else sorted[place] = edge;
        }
    }
}

/* Where the edges to a vertex end, within a first vertex's. */
static uint32_t end_of(const struct colonnade_triangle *triangles, const uint32_t *sorted, uint32_t low, uint32_t high,
                       uint32_t vertex) {
    while (low < high) {
        const uint32_t middle = low + (high - low) / 2;
        if (at_edge(triangles, sorted[middle], 1) <= vertex) low = middle + 1;
        else high = middle;
    }
    return low;
}

uint32_t colonnade_mesh_pairs(const struct colonnade_mesh *layout, const struct colonnade_vertex *vertices,
                              uint32_t vertex_count, const struct colonnade_triangle *triangles, uint32_t count,
                              struct colonnade_leaf *leaves, uint32_t *scratch) {
    uint32_t *const ends = scratch, *const sorted = ends + vertex_count;
    uint32_t found = 0;
    uint8_t *const is_taken = (uint8_t *)(sorted + 3 * (size_t)count);
    sort_edges(triangles, count, ends, vertex_count, sorted, leaves);
    for (uint32_t i = 0; i < count; ++i) is_taken[i] = 0;
    for (uint32_t i = 0; i < count; ++i) {
        const struct colonnade_triangle *own = &triangles[i];
        struct colonnade_leaf *leaf = &leaves[found];
        uint64_t least = UINT64_MAX;
        uint32_t partner = i;
        if (is_taken[i]) continue;
        *leaf = (struct colonnade_leaf){
            {own->vertices[0], own->vertices[1], own->vertices[2], UINT32_MAX}, own->material, own->is_clear};
        for (uint32_t corner = 0; corner < 3; ++corner) {
            const uint32_t a = own->vertices[corner], b = own->vertices[(corner + 1) % 3],
                           c = own->vertices[(corner + 2) % 3];
            const uint32_t begin = b == 0 ? 0 : ends[b - 1], end = end_of(triangles, sorted, begin, ends[b], a);
            for (uint32_t k = end; k > begin && end - k < MOST_NEIGHBOURS; --k) {
                const uint32_t edge = sorted[k - 1], other = edge / 3, pair[4] = {a, b, c, at_edge(triangles, edge, 2)};
                const struct colonnade_triangle *its = &triangles[other];
                int32_t low[3], high[3];
                if (at_edge(triangles, edge, 1) != a) break;
                if (is_taken[other] || other == i) continue;
                if (its->material != own->material || its->is_clear != own->is_clear) continue;
                bounds(vertices, pair, low, high);
                const uint64_t area = colonnade_half_area(low, high);
                if (area >= least || !is_near(layout, low, high)) continue;
                least = area;
                partner = other;
                for (int j = 0; j < 4; ++j) leaf->vertices[j] = pair[j];
            }
        }
        is_taken[i] = is_taken[partner] = 1;
        ++found;
    }
    return found;
}

/* Every third bit, from the lowest on. */
static uint32_t spread(uint32_t value) {
    uint32_t result = 0;
    for (int bit = 0; bit < CODE_BITS; ++bit) result |= (value >> bit & 1) << (3 * bit);
    return result;
}

/* The place of the middle of a leaf on a curve that stays near. */
static uint32_t code_of(const struct colonnade_mesh *mesh, const struct colonnade_vertex *vertices,
                        const struct colonnade_leaf *leaf) {
    const int down = mesh->vertex_bits + 1 - CODE_BITS;
    int32_t low[3], high[3];
    uint32_t code = 0;
    bounds(vertices, leaf->vertices, low, high);
    for (int axis = 0; axis < 3; ++axis) code |= spread((uint32_t)(low[axis] + high[axis]) >> down) << axis;
    return code;
}

/* A leaf on its curve. */
struct place {
    uint32_t code, leaf;
};

static void sort(struct place *places, struct place *others, uint32_t count) {
    for (uint32_t low = 0; low < 32; low += DIGIT_BITS) { /* an even number of passes */
        uint32_t starts[DIGITS] = {0};
        for (uint32_t i = 0; i < count; ++i) ++starts[places[i].code >> low & (DIGITS - 1)];
        to_places(starts, DIGITS);
        for (uint32_t i = 0; i < count; ++i) others[starts[places[i].code >> low & (DIGITS - 1)]++] = places[i];
        struct place *const swapped = places;
        places = others;
        others = swapped;
    }
}

/* Where a range of places is cut: where the highest bit changes that is not the same in all. */
static uint32_t cut(const struct place *places, uint32_t begin, uint32_t end) {
    const uint32_t differs = places[begin].code ^ places[end - 1].code;
    if (differs == 0) return begin + (end - begin) / 2;
    const uint32_t bit = (uint32_t)1 << (colonnade_bit_length(differs) - 1);
    uint32_t low = begin, high = end - 1;
    while (high - low > 1) {
        const uint32_t middle = low + (high - low) / 2;
        if ((places[middle].code & bit) != 0) high = middle;
        else low = middle;
    }
    return high;
}

/* Leaves of a node that has no record yet. */
struct range {
    uint32_t begin, end, address, depth;
};

void colonnade_mesh_build(struct colonnade_mesh *mesh, const struct colonnade_vertex *vertices,
                          const struct colonnade_leaf *leaves, uint32_t count, uint8_t *leaf_words, uint32_t *copy,
                          uint32_t root, uint32_t *scratch) {
    struct place *const places = (struct place *)scratch;
    struct range pending[MOST_RANGES] = {{0, count, root, 1}};
    uint32_t ranges = 1, next = root + 1;
    for (uint32_t i = 0; i < count; ++i) places[i] = (struct place){code_of(mesh, vertices, &leaves[i]), i};
    sort(places, places + count, count);
    mesh->leaf_records = 1;
    mesh->depth = mesh->leaves = 0;
    mesh->leaf_words = leaf_words;
    while (ranges > 0) {
        const struct range range = pending[--ranges];
        uint32_t ends[COLONNADE_MESH_CHILDREN + 1] = {range.begin, range.end}, children = 1, nodes = 0;
        /* Halves, then quarters; ranges of one leaf are not cut */
        for (int round = 0; round < 2; ++round)
            for (uint32_t i = children; i-- > 0;) {
                if (ends[i + 1] - ends[i] == 1) continue;
                for (uint32_t j = ++children; j > i + 1; --j) ends[j] = ends[j - 1];
                ends[i + 1] = cut(places, ends[i], ends[i + 2]);
            }
        for (uint32_t i = 0; i < children; ++i) nodes += ends[i + 1] - ends[i] > 1;
        uint32_t *record = copy + (size_t)RECORD_WORDS * (range.address - root);
        struct colonnade_writer writer = {record, 0, 0};
        colonnade_pad(&writer, record, colonnade_node_head(mesh));
        colonnade_put_node_head(mesh, &writer, record, next, children - nodes, nodes);
        if (range.depth > mesh->depth) mesh->depth = range.depth;
        uint32_t address = next + nodes, below = nodes;
        for (uint32_t i = children; i-- > 0;) {
            if (ends[i + 1] - ends[i] > 1)
                pending[ranges++] = (struct range){ends[i], ends[i + 1], next + --below, range.depth + 1};
        }
        for (uint32_t i = 0; i < children; ++i) {
            if (ends[i + 1] - ends[i] > 1) continue;
            const struct colonnade_leaf *leaf = &leaves[places[ends[i]].leaf];
            record = copy + (size_t)RECORD_WORDS * (address++ - root);
            writer = (struct colonnade_writer){record, 0, 0};
            colonnade_put_leaf_head(&writer, record, leaf->material | (uint32_t)leaf->is_clear << 8, 0);
            for (uint32_t k = 0; k < 4 * LEAF_WORDS; ++k)
                leaf_words[4 * (size_t)LEAF_WORDS * mesh->leaves + k] =
                    (uint8_t)(leaf->vertices[k / 4] >> (8 * (k % 4)));
            ++mesh->leaves;
        }
        next += children;
    }
    mesh->records = next - root;
}
