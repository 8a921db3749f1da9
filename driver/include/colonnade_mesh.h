/* SPDX-License-Identifier: Apache-2.0 */
/* Meshes that bend: docs/driver.md.
 *
 * Integers only: no allocation, no floating point, no library. The same clip gives the same records on every processor.
 */
#ifndef COLONNADE_MESH_H
#define COLONNADE_MESH_H

#include "colonnade.h"

#ifdef __cplusplus
extern "C" {
#endif

enum {
    COLONNADE_MESH_CHILDREN = 4,
    COLONNADE_MESH_NO_VERTEX = 0xFFFF /* upper half of a leaf's fourth vertex, if it is a triangle */
};

/* A clip: vertices, what moves them, and the leaves that have them. Only the functions below read and write it. It
 * points into the clip file. */
struct colonnade_mesh {
    int32_t vertex_bits, delta_bits, box_bits, address_bits;
    uint32_t leaf_records; /* a leaf's: 2 with corner colours, else 1 */
    uint32_t records;      /* of the mesh, nodes and leaves */
    uint32_t depth;        /* nodes on the longest path from the root */
    uint32_t vertices, leaves, bones, targets, changes, keys;
    uint32_t duration;    /* 2^-16 s */
    int32_t linear_shift; /* fraction bits of matrices beyond translations' */
    int32_t shift;        /* fraction bits of translations */
    const uint8_t *vertex_words, *leaf_words, *change_words, *key_words;
};

/* A vertex of a pose, on the object's grid. */
struct colonnade_vertex {
    int32_t position[3];
    int16_t normal[2]; /* octahedral code */
};

/* The caller's memory for a node on the path from the root. */
struct colonnade_mesh_node {
    int32_t low[COLONNADE_MESH_CHILDREN][3], high[COLONNADE_MESH_CHILDREN][3];
    uint32_t address, first;
    uint32_t nodes, children, next, leaf;
};

/* What a refit has found. */
struct colonnade_refit {
    int32_t low[3], high[3]; /* bounds of the mesh, vertex units */
    uint32_t flat_pairs;     /* pairs that are too stretched for normals at their corners */
    uint32_t cost;           /* nodes that a ray through the bounds reads on average, 2^-8: a tree wears as it bends */
};

/* Reads a clip file, which `colonnade pack --clip-file` writes. */
enum colonnade_error colonnade_mesh_open(struct colonnade_mesh *mesh, const struct colonnade_design *design,
                                         const void *data, size_t bytes);

/* The bones' matrices and the weights of morph targets at a time, 2^-16 s; the clip repeats. */
void colonnade_mesh_pose(const struct colonnade_mesh *mesh, uint32_t time, int32_t *pose);
/* The words of a pose. */
uint32_t colonnade_mesh_pose_words(const struct colonnade_mesh *mesh);

/* The mesh's vertices in a pose; an error if one leaves the object's grid. */
enum colonnade_error colonnade_mesh_skin(const struct colonnade_mesh *mesh, const int32_t *pose,
                                         struct colonnade_vertex *vertices);

/* Makes a copy of the mesh's records for another root, since nodes hold addresses. `from` and `copy` point at the
 * roots, which have the addresses `from_root` and `root`; they do not overlap. `path` is as for colonnade_mesh_refit.
 */
enum colonnade_error colonnade_mesh_copy(const struct colonnade_mesh *mesh, const uint32_t *from, uint32_t from_root,
                                         uint32_t *copy, uint32_t root, struct colonnade_mesh_node *path);

/* Writes vertices into a copy of the mesh's records, whose root has the address `root`. Each record is written once; of
 * the tree none changes its place or its kind. `copy` points at the root, in the device's order of bytes, low byte
 * first; `path` has space for mesh->depth nodes. No frame may read the copy meanwhile, and the next one that does needs
 * `control.invalidate`. A copy that is refused as COLONNADE_OTHER_RECORDS may be written in part. */
enum colonnade_error colonnade_mesh_refit(const struct colonnade_mesh *mesh, const struct colonnade_vertex *vertices,
                                          uint32_t *copy, uint32_t root, struct colonnade_mesh_node *path,
                                          struct colonnade_refit *result);

enum { COLONNADE_MESH_WRITES = 3 };

/* The pairs of words of a frame that reads the copy at `root`, of a scene that is this mesh alone: they invalidate the
 * caches. `records` is the number of all records of the scene with its copies, `writes` has space for
 * COLONNADE_MESH_WRITES pairs. Answers their number, 0 if the scene lies on chip. Set them by colonnade_set_frame after
 * a view's. */
uint32_t colonnade_mesh_writes(const struct colonnade_design *design, uint32_t root, uint32_t records, uint8_t *writes);

enum {
    COLONNADE_PLAN_WORDS = 4,   /* of an entry */
    COLONNADE_PLAN_BOXES = 128, /* that the unit holds */
    COLONNADE_LINE_VERTICES = 4 /* of a line, which the unit reads at once */
};

/* Writes the plan of a refit in hardware: what `refit.plan` points at, the same for all copies and all poses. Answers
 * its entries; with `plan` NULL it only counts them. `lines` has space for a word for each line of vertices. */
enum colonnade_error colonnade_mesh_plan(const struct colonnade_mesh *mesh, const uint32_t *copy, uint32_t root,
                                         struct colonnade_mesh_node *path, uint32_t *lines, uint32_t *plan,
                                         uint32_t *entries);

/* A refit for the unit of the shell: bus addresses, and numbers. What the processor has written there is in memory. */
struct colonnade_refit_job {
    uint64_t plan, vertices;      /* multiples of 64 */
    uint64_t records;             /* of the root's record, a multiple of 32 */
    uint32_t entries;             /* of the plan */
    uint32_t vertex_count, count; /* of the mesh: vertices, records */
    uint32_t root;                /* the root's address in the scene */
};

/* Starts a refit, also while a frame runs that does not read this copy. With an error nothing is written. Acknowledges
 * refitDone. */
enum colonnade_error colonnade_refit_start(struct colonnade *device, const struct colonnade_refit_job *job);

/* Waits for its end, as colonnade_wait does for refitDone; polls if the shell lacks this event. `result` has no cost.
 * After an error of the unit, COLONNADE_BUS_RESPONSE or, of a plan, COLONNADE_OTHER_RECORDS, the copy may be written in
 * part. */
enum colonnade_error colonnade_refit_wait(struct colonnade *device, uint32_t attempts, struct colonnade_refit *result);

/* A triangle of the program's own. */
struct colonnade_triangle {
    uint32_t vertices[3];
    uint8_t material;
    bool is_clear;
};

/* Triangles (0, 1, 2) and (1, 0, 3), or the first of them: the fourth vertex is then UINT32_MAX. */
struct colonnade_leaf {
    uint32_t vertices[4];
    uint8_t material;
    bool is_clear;
};

/* Pairs triangles along edges, each with the neighbour that gives the smallest box, of 32 at an edge. Answers the
 * number of leaves. `layout` is any clip of the design. Space: `leaves` for count, scratch vertex_count + 4 * count
 * words. */
uint32_t colonnade_mesh_pairs(const struct colonnade_mesh *layout, const struct colonnade_vertex *vertices,
                              uint32_t vertex_count, const struct colonnade_triangle *triangles, uint32_t count,
                              struct colonnade_leaf *leaves, uint32_t *scratch);

/* Builds a tree over leaves, by the places of vertices; colonnade_mesh_refit writes its boxes. `mesh` is a copy of any
 * clip of the design, and becomes the leaves': it can be refitted and planned, and has no pose. Space: leaf_words 16
 * bytes and scratch 4 words a leaf, copy at most 2 records a leaf. Packed ids are new ones. */
void colonnade_mesh_build(struct colonnade_mesh *mesh, const struct colonnade_vertex *vertices,
                          const struct colonnade_leaf *leaves, uint32_t count, uint8_t *leaf_words, uint32_t *copy,
                          uint32_t root, uint32_t *scratch);

#ifdef __cplusplus
}
#endif

#endif
