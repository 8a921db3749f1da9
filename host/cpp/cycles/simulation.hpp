// The cycles of a frame whose work the bit-exact model has noted.
#pragma once
#include <map>
#include <string>

#include "design.hpp"
#include "model/frame.hpp"

namespace colonnade::cycles {

/// Counters by their names in the register map.
using CycleCounters = std::map<std::string, std::int64_t>;

/// The counters of a frame that depend on time, and `raysInBox`, `nodeReads`, `triangleTests` as the simulated units
/// count them.
///
/// `work`: of all pixels, rows first; `frame`: its registers; `height`: its rows. Throws std::invalid_argument for
/// designs that are not modelled.
CycleCounters simulate(const Design& design, const DramDesign& dram, const FrameWork& work, const Frame& frame,
                       unsigned height);

} // namespace colonnade::cycles
