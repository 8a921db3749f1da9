/* Normals of a depth map and the light cube of an object (cpp/environment) behind C. Maps are row by row; vectors have
 * three doubles. */
#ifndef COLONNADE_ENVIRONMENT_H
#define COLONNADE_ENVIRONMENT_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* The number of the nearest pixel of each that is not missing; -1 if all are. */
void colonnade_environment_nearest(const uint8_t *missing, int32_t width, int32_t height, int32_t *nearest);

/* Depth of a part of a photo, at width x height pixels of maps; `size` and `whole`: width and height of the depth map,
 * and of the photo. `part`: the first pixel of the photo, left and top, and pixels of it per pixel of the maps. A hole
 * is 0. */
void colonnade_environment_depth(const double *depth, const int32_t *size, const int32_t *whole, const double *part,
                                 int32_t width, int32_t height, double *fitted);

/* Unit normals of filled depth, view space, towards the camera. `lens`: fx, fy, cx, cy, pixels. Returns the noise of
 * the depth, as a share. */
double colonnade_environment_normals(const double *depth, const uint8_t *holes, int32_t width, int32_t height,
                                     const double *lens, double *normals);

/* The plane m with m . p = 1 at points, by least squares. */
void colonnade_environment_plane(const double *points, uint32_t count, double *plane);

/* The words of the device's cube for an object whose axes are `rotation`, row by row, from `radiance`, 6 faces of 32 x
 * 32 texels. */
void colonnade_environment_cube(const double *radiance, const double *rotation, uint32_t *words);

/* The radiance that words hold. */
void colonnade_environment_radiance(const uint32_t *words, uint32_t count, double *radiance);

/* The light of pixels around a point, 6 faces of 32 x 32 texels, and its mean where they show none. Returns the share
 * of directions that they show. */
double colonnade_environment_seen(const double *points, const double *normals, const double *colours, uint32_t count,
                                  const double *point, double *radiance);

/* The register gather.parallax of a point in a box, `bounds` low and high, for an object whose cube has this edge. */
int32_t colonnade_environment_parallax(const double *bounds, const double *point, double edge);

#ifdef __cplusplus
}
#endif
#endif
