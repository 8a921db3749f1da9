// Rays through the records of the column memory: closest hits and occluders, with counters and errors.
#pragma once
#include <memory>

#include "column_memory.hpp"
#include "ray_log.hpp"
#include "registers.hpp"

namespace colonnade {

/// Timing-independent counters, named as in the register map.
struct Counters {
    std::uint64_t raysPrimary, raysShadow, raysReflection, raysRefraction, raysInBox, nodeReads, boxTests, triangleTests, hits, deepestStack;
    /// Environment lookups, march steps (tiles and cells), and hits in the maps.
    std::uint64_t raysEnvironment, marchSteps, albedoReads;
    std::uint64_t raysGather;
};

struct Errors {
    bool stackOverflow, illegalRecord, watchdog;
};

/// Result of a shadow ray, ordered by decreasing transmittance.
enum class Occlusion { none, transmissive, opaque };

/// What an application's ray does not hit: triangles of a side, non-opaque ones, those without a bit of its mask.
struct RayFilter {
    bool cullsFront, cullsBack, refusesClear;
    int mask; ///< of leaves, in place of their material

    bool accepts(const Hit& hit, const Leaf& leaf) const {
        return !(hit.backSide ? cullsBack : cullsFront) && !(refusesClear && hit.isClear) && (leaf.material & mask) != 0;
    }
};

/// Finds the hits of prepared rays. Copies share the column memory.
class Tracer {
public:
    /// The closest hit of a prepared ray.
    Hit trace(const Ray& ray, const RayFilter* filter = nullptr) {
        const Hit best = Hit::none(ray.tMax);
        if (!ray.enters) return best;
        const Hit hit = frame_.instances.empty() ? search(ray, filter, false).best : nearestOfInstances(ray, best);
        if (hit.found) log.addHit(hit.id, static_cast<double>(hit.t));
        return hit;
    }

    /// The occluders of a prepared shadow ray; the first opaque triangle ends the search.
    Occlusion occlusion(const Ray& ray, const RayFilter* filter = nullptr) {
        if (!ray.enters) return Occlusion::none;
        return frame_.instances.empty() ? search(ray, filter, true).occlusion : occlusionByInstances(ray);
    }

    Counters counters{};
    Errors errors{};
    RayLog log;

protected:
    Tracer(const Numbers& numbers, const std::map<std::string, Layout>& layouts) : numbers_(numbers), memory_(std::make_shared<ColumnMemory>(layouts, numbers)) {}

    Numbers numbers_;
    std::shared_ptr<ColumnMemory> memory_;
    Frame frame_;

private:
    struct StackEntry {
        bool isLeaf;
        std::uint32_t address;
        std::int64_t tNear;
    };

    /// State of a ray's traversal. A shadow ray keeps its tMax, as transmissive triangles do not end it.
    struct TraceState {
        const Ray& ray;
        std::size_t root;
        Hit best;
        bool isShadow;
        const RayFilter* filter;
        Occlusion occlusion;

        bool isOver() const { return occlusion == Occlusion::opaque; }
    };

    /// Traces a prepared ray from a root, by default that of the scene.
    TraceState search(const Ray& ray, const RayFilter* filter, bool isShadow, std::size_t instance = 0) {
        ++counters.raysInBox;
        TraceState state{ray, frame_.roots[instance], Hit::none(ray.tMax), isShadow, filter, Occlusion::none};
        run(state);
        return state;
    }

    /// The nearest hit of a ray of the world: the least (t, instance, id), t along that ray.
    Hit nearestOfInstances(const Ray& world, Hit best) {
        for (std::size_t i = 0; i < frame_.instances.size(); ++i) {
            if (!instances::mayEnter(world, world.tMax, frame_.instances[i].box, numbers_)) continue;
            const ObjectRay object = instances::toObject(world, best.t, frame_.instances[i], numbers_);
            const Ray ray = prepareRay(object.request, instances::cube(numbers_), numbers_);
            if (!ray.enters) continue;
            Hit hit = search(ray, nullptr, false, i).best;
            if (!hit.found) continue;
            hit.t = instances::toWorld(floorShift<Wide>(ray.tEntry, -numbers_.gridFraction) + hit.t, object, numbers_);
            hit.instance = static_cast<int>(i);
            if (hit.t < best.t) best = hit;
        }
        return best;
    }

    /// What a shadow ray of the world meets; the first opaque triangle ends the search.
    Occlusion occlusionByInstances(const Ray& world) {
        Occlusion occlusion = Occlusion::none;
        for (std::size_t i = 0; i < frame_.instances.size() && occlusion != Occlusion::opaque; ++i) {
            if (!instances::mayEnter(world, world.tMax, frame_.instances[i].box, numbers_)) continue;
            const ObjectRay object = instances::toObject(world, world.tMax, frame_.instances[i], numbers_);
            const Ray ray = prepareRay(object.request, instances::cube(numbers_), numbers_);
            if (ray.enters) occlusion = std::max(occlusion, search(ray, nullptr, true, i).occlusion);
        }
        return occlusion;
    }

    void run(TraceState& state) {
        if (numbers_.bvh) traverse(state);
        else
            for (std::size_t i = 0; (i == 0 || i < frame_.recordCount) && !state.isOver(); i += frame_.leafRecords()) testRecord(state, i);
    }

    void testRecord(TraceState& state, std::size_t address) {
        address &= memory_->addressMask();
        const Leaf* const found = memory_->leafAt(address);
        if (!found) {
            errors.illegalRecord = true;
            return;
        }
        const Leaf& leaf = *found;
        log.addRead(RayStep::Kind::record, address);
        for (int i = 0; i < leaf.triangles(); ++i) {
            ++counters.triangleTests;
            Hit hit = state.best;
            const std::uint64_t id = leafTriangles * address + static_cast<std::uint64_t>(i);
            const bool isHit = testTriangle(state.ray, leaf.verticesOf(i), id, numbers_, hit);
            log.addTriangle(leaf.verticesOf(i), id, isHit);
            hit.isClear = leaf.isClear;
            if (!isHit || (state.filter && !state.filter->accepts(hit, leaf))) continue;
            if (state.isShadow)
                state.occlusion = std::max(state.occlusion, hit.isClear && frame_.lighting.hasTransmittance ? Occlusion::transmissive : Occlusion::opaque);
            else state.best = hit;
        }
    }

    void traverse(TraceState& state) {
        const Hit& best = state.best;
        std::array<StackEntry, 256> stack;
        std::size_t depth = 0;
        std::uint64_t nodeVisits = 0;
        StackEntry next{false, static_cast<std::uint32_t>(state.root), 0};
        for (bool busy = !errors.watchdog; busy;) {
            busy = false;
            if (next.isLeaf) {
                testRecord(state, next.address);
                if (state.isOver()) return;
            } else if (const Node* const found = memory_->nodeAt(next.address); !found) {
                errors.illegalRecord = true;
            } else {
                // A node visit takes at least one cycle
                if (frame_.watchdogCycles != 0 && ++nodeVisits > frame_.watchdogCycles) {
                    errors.watchdog = true;
                    return;
                }
                ++counters.nodeReads;
                const Node& node = *found;
                std::array<Entered, nodeChildren> entered;
                int count = 0;
                if (node.isLegal) count = testBoxes(state.ray, node, best.t, numbers_, entered, counters.boxTests);
                else errors.illegalRecord = true;
                if (log.isOn()) logNode(next.address, node, entered, count);
                for (int i = count - 1; i > 0; --i) {
                    if (depth < static_cast<std::size_t>(numbers_.stackDepth)) stack[depth++] = entryOf(node, entered[i]);
                    else errors.stackOverflow = true;
                }
                counters.deepestStack = std::max<std::uint64_t>(counters.deepestStack, depth);
                if (count > 0) {
                    next = entryOf(node, entered[0]);
                    busy = true;
                }
            }
            while (!busy && depth > 0) {
                next = stack[--depth];
                busy = next.tNear <= tMaxUnits(best.t, numbers_);
            }
        }
    }

    void logNode(std::uint32_t address, const Node& node, const std::array<Entered, nodeChildren>& entered, int count) const {
        log.addRead(RayStep::Kind::node, address);
        for (int slot = 0; node.isLegal && slot < node.children(); ++slot) {
            const bool isHit = std::any_of(entered.begin(), entered.begin() + count, [slot](const Entered& child) { return child.slot == slot; });
            log.addChild(node, slot, entryOf(node, {slot, 0}).address, isHit);
        }
    }

    StackEntry entryOf(const Node& node, const Entered& child) const {
        const auto slot = static_cast<std::uint32_t>(child.slot), nodes = static_cast<std::uint32_t>(node.nodes);
        const bool isLeaf = slot >= nodes;
        const std::uint32_t offset = isLeaf ? nodes + (slot - nodes) * static_cast<std::uint32_t>(frame_.leafRecords()) : slot;
        return {isLeaf, (node.first + offset) & memory_->addressMask(), child.tNear};
    }
};

} // namespace colonnade
