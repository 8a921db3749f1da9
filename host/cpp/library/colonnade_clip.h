/* The clip that bends the packed mesh, by driver/src/colonnade_mesh.c, for colonnade_model.cpp: structures of the
 * driver have names of the model's. Each call returns 0, or an error of the driver. */
#ifndef COLONNADE_CLIP_H
#define COLONNADE_CLIP_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Opens a clip file for a design of this hash; the file stays the caller's. */
int32_t colonnade_clip_open(const uint32_t format_hash[8], const uint8_t *file, uint32_t bytes);

/* The vertices of a pose: positions and codes of normals. */
int32_t colonnade_clip_skin(const int32_t *pose, int32_t (*positions)[3], int16_t (*normals)[2]);

/* Writes the vertices of a time, 2^-16 s, into records, whose root is the first; how many pairs are too stretched for
 * normals. */
int32_t colonnade_clip_refit(uint32_t time, uint32_t *records, uint32_t *flat_pairs);

#ifdef __cplusplus
}
#endif

#endif
