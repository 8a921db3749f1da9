/* The packer and the bit-exact model without Python, behind C: docs/browser.md. With driver/include/colonnade_view.h,
 * which computes registers from poses, it renders meshes as a design does. One design at a time, from one thread. */
#ifndef COLONNADE_MODEL_H
#define COLONNADE_MODEL_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* A picture: rows of red, green, blue. Beyond it (wrap) 0 repeats it, 1 mirrors it, 2 repeats its border. */
struct colonnade_texture {
    const uint8_t *pixels;
    int32_t width, height, wrap_u, wrap_v, is_nearest;
};

/* What faces of a mesh are: an entry of the material table, glass or not, and what their corners have, times a factor.
 */
struct colonnade_surface {
    int32_t entry, is_glass;
    int32_t texture;     /* of base colours, sRGB; -1: none */
    int32_t has_colours; /* of the mesh, for a design with corner colours */
    double factor[3];
};

/* A picture as a normal map; `scale` is a factor of its tangential components. */
struct colonnade_normal_map {
    int32_t texture;
    float scale;
};

/* Values of a node over time. `path`: 0 translation, 1 rotation, 2 scale, 3 weights of morph targets. `interpolation`:
 * 0 steps, 1 lines, 2 cubic splines, of which each key has three values. Times are seconds; keys ascend. */
struct colonnade_track {
    int32_t node, path, interpolation;
    uint32_t key_count, value_count;
    const double *times, *values;
};

/* What moves the vertices of a mesh. Of nodes: parents, −1 for none, and themselves, each after its parent; matrices to
 * the parents at rest, row by row, and their parts. Of bones: node, and matrix from where vertices are bound. Of
 * vertices: where they are bound, four bones and their weights, the largest first. Of morph targets: node, place among
 * its weights, weight at rest. Of their changes, by ascending vertex: target, vertex, what is added. */
struct colonnade_clip {
    uint32_t node_count;
    const int32_t *parents, *order;
    const double *matrices, *translations, *rotations, *scales;
    uint32_t track_count;
    const struct colonnade_track *tracks;
    uint32_t bone_count;
    const int32_t *joints;
    const double *inverses;
    uint32_t vertex_count;
    const double *positions;
    const int32_t *bones;
    const double *weights;
    uint32_t target_count;
    const int32_t *target_nodes, *target_places;
    const double *target_weights;
    uint32_t change_count;
    const int32_t *change_targets, *change_vertices;
    const double *changed_positions, *changed_normals;
};

/* `normals`: three for each face, of any length, 0 for none; or NULL. `colours`: linear red, green, blue at the
 * corners, 0 to 1; or NULL. `uvs`: two at each corner; NULL without textures. `surface_of`: of each face. With
 * `map_count`, of each face: the number of its normal map, -1 for none; at each corner two positions in it, and a
 * tangent of the file, 0 for none, with the sign of the bitangent. `clip`: what moves the vertices, which are in its
 * rest pose, or NULL; then of each face the face of the file that it is a part of, and the weights of that one's
 * corners at each corner; `clip_faces` have the clip's vertices at the corners of the file's faces. */
struct colonnade_mesh {
    const double *vertices;
    uint32_t vertex_count;
    const int32_t *faces;
    uint32_t face_count;
    const double *normals, *colours, *uvs;
    const int32_t *surface_of;
    const struct colonnade_surface *surfaces;
    const struct colonnade_texture *textures;
    uint32_t texture_count;
    const struct colonnade_normal_map *maps;
    uint32_t map_count;
    const int32_t *map_of;
    const double *map_uvs, *tangents;
    const struct colonnade_clip *clip;
    const int32_t *clip_faces, *clip_owners;
    const double *clip_weights;
};

/* A mesh as it is packed: numbers of records, bounds in vertex units. */
struct colonnade_packed {
    int32_t triangles, record_count, nodes, leaves, has_colours;
    int32_t bounds_low[3], bounds_high[3];
    int32_t shading_offset; /* register shading.offset, grid steps */
    int32_t tree_depth, stack_bound;
    int32_t dropped;  /* faces of the mesh that are equal to another one or have no area */
    int32_t flipped;  /* faces whose normals pointed to their back, and were negated */
    int32_t replaced; /* corners whose normal pointed to the back of their face, or that had none */
    int32_t reversed; /* closed parts that did not point outward, and do now */
    int32_t smoothed; /* degrees in the root mean square that corner normals differ from normal maps; 0 below 3 */
    int32_t duration; /* of its clip, 2^-16 s; 0 without one */
};

/* The faces of a material with alpha: positions, places in the texture and alpha of their corners. */
struct colonnade_alpha {
    const double *corners, *uvs, *alphas;
    uint32_t count;
    const struct colonnade_texture *texture; /* NULL: none */
    const uint8_t *alpha;                    /* of the texture's pixels; NULL: opaque */
    const double *values; /* factor; cutoff; factor of panes, -1 for a mask; edges below it are not split */
    int32_t budget;       /* pieces that may be added */
};

/* What of them is shown; it is valid until the next call. */
struct colonnade_cut {
    const int8_t *kinds; /* of each face 1 shown, -1 hidden, 0 by its pieces */
    uint32_t piece_count;
    const int32_t *owners;
    const double *weights; /* of the owner's corners, at each corner of a piece */
    const double *panes;   /* of a blended material, alpha and mean colour of each hidden face */
    int32_t is_coarse, is_blended;
    const uint8_t *filled; /* the texture without its hidden pixels */
};

/* Parts of faces, by the faces; they are valid until the next call. */
struct colonnade_pieces {
    uint32_t count;
    const int32_t *owners;
    const double *weights; /* as of colonnade_cut */
};

struct colonnade_step {
    int32_t
        kind; /* 0 a ray, 1 a node is read, 2 a child's box, 3 a record of triangles is read, 4 a triangle, 5 a hit */
    int32_t value; /* ray: 0 primary, 1 shadow, 2 reflection, 3 refraction, 4 gathered; an address; a packed id */
    int32_t is_hit; /* box entered, triangle the closest so far */
    int32_t is_leaf; /* the child is a record of triangles */
    double values[9]; /* vertex units: origin and direction, low and high, vertices; of a hit, t in grid steps */
};

/* Every call but the last five returns NULL, or a text that says what is wrong. */

/* Opens a design, by lines of words from its manifest:
 *   number NAME VALUE                             numbers; stackDepth, bvh, recordBits, depth
 *   layout RECORD FIELD OFFSET WIDTH SIGNED       of records
 *   register NAME ADDRESS WORDS WIDTH SIGNED LIMIT   written ones; limit -1 for none
 * and for a design with the maps of a room, or with textures:
 *   size NAME VALUE                               of the maps
 *   map RECORD FIELD OFFSET WIDTH SIGNED          of their words
 *   textureSize, textureMap                       the same of the texture memory */
const char *colonnade_model_open(const char *design);

/* The vertices of a clip in its rest pose, and whether each of so many faces is mirrored there: its corners go
 * backwards. `normals`, of the corners of faces, follow them; or NULL. */
const char *colonnade_model_rest(const struct colonnade_clip *clip, const int32_t *faces, uint32_t face_count,
                                 double *normals, double *vertices, uint8_t *is_mirrored);

/* Cleans and packs a mesh, and loads it, with the atlas of its textures, into the model. */
const char *colonnade_model_pack(const struct colonnade_mesh *mesh, struct colonnade_packed *packed);

/* Loads records in place of a packed mesh. */
const char *colonnade_model_load(const uint8_t *records, uint32_t count);

/* Loads the clip file of these records; of 0 bytes: nothing moves. */
const char *colonnade_model_load_clip(const uint8_t *file, uint32_t bytes);

/* Writes a pose into the records, of a time in 2^-16 s. Answers how many pairs are too stretched for the normals of
 * their corners. */
const char *colonnade_model_pose(uint32_t time, uint32_t *flat_pairs);

/* Loads one of the memories of a room's maps or of textures, or the light cube, by its name in the manifest: `count`
 * words of `bytes` bytes. */
const char *colonnade_model_load_memory(const char *memory, const uint8_t *words, uint32_t count, uint32_t bytes);

/* Writes registers, pairs of word address and value, low byte first, and starts a frame. */
const char *colonnade_model_start(const uint8_t *writes, uint32_t count);

/* Renders rows first to last − 1: linear red, green, blue, the ratios of light with the object to light without it,
 * 4096 for 1, and the packed id or −1, of each pixel. */
const char *colonnade_model_rows(uint32_t first, uint32_t last, uint16_t *colours, uint16_t *ratios,
                                 int32_t *triangles);

/* The steps of a pixel's rays; they are valid until the next call. */
uint32_t colonnade_model_trace(uint32_t x, uint32_t y, const struct colonnade_step **steps);

/* Cuts the faces of a material by its alpha. */
const char *colonnade_model_cut(const struct colonnade_alpha *alpha, struct colonnade_cut *cut);

/* Which of so many faces show one colour of a texture, 0 or 1, and the linear colours of their corners. */
const char *colonnade_model_swatches(const struct colonnade_texture *texture, const double *uvs, uint32_t count,
                                     uint8_t *is_plain, double *colours);

/* Which of so many faces are metal, 0 or 1, and their mean roughness, by a metallic-roughness map: `uvs` of the
 * corners, and the factors of metallic and roughness. */
const char *colonnade_model_metal(const struct colonnade_texture *map, const double *uvs, uint32_t count,
                                  const double *factors, uint8_t *is_metal, double *roughness);

/* What so many faces emit by an emission map, linear, at most four colours: `uvs` of the corners, and the faces' areas.
 */
const char *colonnade_model_emission(const struct colonnade_texture *map, const double *uvs, const double *areas,
                                     uint32_t count, double *colours);

/* Faces in pieces where what they emit by a map varies: factors of its channels, which faces show it, 0 or 1, `uvs` of
 * the corners in it, and the pieces that may be added. */
const char *colonnade_model_emission_pieces(const struct colonnade_texture *map, const double *factors,
                                            const double *vertices, uint32_t vertex_count, const int32_t *faces,
                                            uint32_t face_count, const uint8_t *shows, const double *uvs,
                                            int32_t budget, struct colonnade_pieces *pieces);

/* Merges the nearest of values of equal kinds until so many are left, by their weights; `merged` has the new value of
 * each. */
const char *colonnade_model_merge(const double *values, const double *weights, const int32_t *kinds, uint32_t count,
                                  uint32_t left, double *merged);

/* The words of a memory of textures for the packed mesh, each of whole bytes, low byte first. */
const uint8_t *colonnade_model_texture(const char *memory);

/* The records of the packed mesh. */
const uint8_t *colonnade_model_records(void);

/* The clip file of the packed mesh, and its bytes. */
const uint8_t *colonnade_model_clip(uint32_t *bytes);

/* Counters of the frame that the model has: primary, shadow, reflected, refracted, gathered and in-box rays, nodes
 * read, boxes tested, triangles tested, hits, deepest stack. */
const double *colonnade_model_counters(void);

#ifdef __cplusplus
}
#endif

#endif
