/* The readers of OBJ with MTL, PLY, STL and OFF (cpp/mesh/files/reader.hpp) behind C. One file at a time. Texts are
 * UTF-8 if those of the file are, and valid until the next call; a refusal is one line, NULL for none. */
#ifndef COLONNADE_READ_H
#define COLONNADE_READ_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* The triangles of a file; arrays without one are NULL. Corners have three of `normals` and `colours`, NaN on faces
 * without a colour, and two of `uvs`. A material has eleven numbers: kind (0 diffuse, 1 mirror, 2 glass), albedo, index
 * of refraction, roughness, emission, factor of alpha or -1, texture or -1. A texture has three: the numbers that
 * `finish` gave to the pictures of its colours and of its alpha, -1 for opaque, and whether it is white. */
struct colonnade_read {
    const double *vertices;
    uint32_t vertex_count;
    const int32_t *faces;
    uint32_t face_count;
    const double *normals, *colours, *uvs;
    const int32_t *material_of;
    const double *materials;
    uint32_t material_count;
    const int32_t *textures;
    uint32_t texture_count;
};

/* Begins to read a file of a format, "obj" and so on; `name` is that of messages. */
const char *colonnade_read_begin(const char *format, const char *name, const uint8_t *bytes, uint32_t count);

/* The name of the next file of materials, NULL after the last one. */
const char *colonnade_read_library(void);

/* Gives the bytes of that file, NULL if it is missing; `name` is that of messages. */
const char *colonnade_read_materials(const char *name, const uint8_t *bytes, uint32_t count);

/* After the materials: the name of a picture, NULL after the last one, and whether its border goes on beyond it. */
const char *colonnade_read_picture(uint32_t index, int32_t *is_clamped);

/* Says that a picture is missing, 0, of an unknown format, 1, or damaged, 2. */
void colonnade_read_lost(uint32_t index, uint32_t loss);

/* Ends the file; `numbers` are those of the pictures, -1 for those that are lost. The surface is valid until the next
 * file. */
const char *colonnade_read_finish(const int32_t *numbers, struct colonnade_read *surface);

/* A line of what is lost of the file, NULL after the last one. */
const char *colonnade_read_note(uint32_t index);

/* The elements of an accessor of a glTF file, in rows, and whether they are integers. */
struct colonnade_array {
    uint32_t count, width, is_whole;
    const double *values;
};

/* Bytes, which are valid until the next call. */
struct colonnade_bytes {
    const uint8_t *bytes;
    uint32_t count;
};

/* Begins to read the document of a glTF file (mesh/files/gltf_document.hpp), and gives its JSON. */
const char *colonnade_gltf_begin(const char *name, const uint8_t *bytes, uint32_t count, struct colonnade_bytes *json);

/* The elements of an accessor that exists: 0; 1 is refused, 2 needs the buffer of a file, of which colonnade_gltf_text
 * tells. */
uint32_t colonnade_gltf_array(uint32_t index, struct colonnade_array *array);

/* The bytes of an image that exists, in the same way; 3: it is in the file of colonnade_gltf_text. */
uint32_t colonnade_gltf_image(uint32_t index, struct colonnade_bytes *image);

/* All nodes of a document: parents, order, and row by row matrices to the parents, translations,
 * rotations and scales. */
struct colonnade_nodes {
    uint32_t count;
    const int64_t *parents, *order;
    const double *matrices, *translations, *rotations, *scales;
};

/* The nodes of the document. */
const char *colonnade_gltf_nodes(struct colonnade_nodes *nodes);

/* The nodes with a mesh of the default scene, and the matrices of their copies to it, row by row: of a node one follows
 * the other. A node that is animated has one. Their losses are those of colonnade_gltf_note. */
struct colonnade_placements {
    uint32_t count;
    const int32_t *nodes, *counts;
    const double *matrices;
};

/* The placements of the document, in the way of colonnade_gltf_array. */
uint32_t colonnade_gltf_placements(uint32_t is_animated, struct colonnade_placements *placements);

/* A line of what is lost of the nodes, NULL after the last one. */
const char *colonnade_gltf_note(uint32_t index);

/* The refusal, or the name of the file. */
const char *colonnade_gltf_text(void);

/* Gives the bytes of that buffer, NULL if it is missing. */
const char *colonnade_gltf_give(const uint8_t *bytes, uint32_t count);

/* The teapot of the host (mesh/teapot.hpp), plain. */
void colonnade_read_teapot(uint32_t level, struct colonnade_read *surface);

/* The alpha of a texture of width times height pixels by another picture (maskOf); `alpha` is that of its pixels, or
 * NULL. */
void colonnade_read_mask(const uint8_t *pixels, const uint8_t *alpha, uint32_t mask_width, uint32_t mask_height,
                         uint32_t width, uint32_t height, uint8_t *mask);

#ifdef __cplusplus
}
#endif

#endif
