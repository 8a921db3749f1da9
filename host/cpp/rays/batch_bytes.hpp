// Bytes of a batch in memory.
#pragma once
#include <cstddef>

#include "colonnade_rays.h"

namespace colonnade::rays {

/// Bytes of a batch's rays, or of its sensor.
inline std::size_t rayBytes(const colonnade_rays_batch& batch) {
    if (batch.mode & COLONNADE_RAYS_SENSOR) return sizeof(colonnade_rays_sensor);
    return batch.count * std::size_t{batch.mode & COLONNADE_RAYS_FAN ? 16u : 32u};
}

/// Bytes of a batch's responses.
inline std::size_t responseBytes(const colonnade_rays_batch& batch) {
    const std::size_t count = batch.count;
    const std::uint32_t response = batch.mode & COLONNADE_RAYS_RESPONSE;
    return response == COLONNADE_RAYS_HITS     ? 16 * count
           : response == COLONNADE_RAYS_RANGES ? 8 * count
                                               : (count + 63) / 64 * 8;
}

} // namespace colonnade::rays
