// Rays through the records of the column memory: closest hits and occluders, with counters and errors.
#pragma once
#include <memory>

#include "column_memory.hpp"
#include "ray_log.hpp"
#include "registers.hpp"
#include "work_log.hpp"

namespace colonnade {

/// Timing-independent counters, named as in the register map.
struct Counters {
    std::uint64_t raysPrimary, raysShadow, raysReflection, raysRefraction, raysInBox, nodeReads, boxTests,
        triangleTests, hits, deepestStack;
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

    bool accepts(const Hit& hit, const LeafTriangles& leaf) const {
        return !(hit.backSide ? cullsBack : cullsFront) && !(refusesClear && hit.isClear) &&
               (leaf.material & mask) != 0;
    }
};

/// What the rays of a scene do: counters, errors, steps and work of one thread.
struct TraceRecord {
    Counters counters{};
    Errors errors{};
    RayLog log;
    WorkLog work;
};

/// What a program keeps of each triangle. It is fetched while the search of the ray that hits one goes on.
struct FaceTable {
    const std::uint32_t* indices = nullptr; ///< of the records, by id; UINT32_MAX for none
    const std::uint8_t* records = nullptr;
    std::size_t bytes = 0; ///< of a record

    bool isEmpty() const { return indices == nullptr; }
    void prefetchIndex(std::uint64_t id) const { __builtin_prefetch(indices + id); }
    void prefetchRecord(std::uint64_t id) const {
        if (indices[id] == UINT32_MAX) return;
        const std::uint8_t* const record = records + indices[id] * bytes;
        __builtin_prefetch(record);
        __builtin_prefetch(record + bytes - 1);
    }
};

/// Finds the hits of prepared rays in a scene that does not change, and notes what it did. It only refers to its
/// arguments.
class SceneSearch {
public:
    SceneSearch(const Numbers& numbers, const ColumnMemory& memory, const Frame& frame, TraceRecord& record,
                FaceTable faces = {})
        : numbers_(numbers), memory_(memory), frame_(frame), record_(record), faces_(faces) {}

    /// The closest hit of a prepared ray.
    Hit trace(const Ray& ray, const RayFilter* filter = nullptr) const {
        const Hit best = Hit::none(ray.tMax);
        if (!ray.enters) return best;
        const Hit hit = frame_.instances.empty() ? search(ray, filter, false).best : nearestOfInstances(ray, best);
        if (hit.found) {
            record_.log.addHit(hit.id, static_cast<double>(hit.t));
            record_.work.addHit();
        }
        return hit;
    }

    /// The occluders of a prepared shadow ray; the first opaque triangle ends the search.
    Occlusion occlusion(const Ray& ray, const RayFilter* filter = nullptr) const {
        if (!ray.enters) return Occlusion::none;
        const Occlusion found =
            frame_.instances.empty() ? search(ray, filter, true).occlusion : occlusionByInstances(ray);
        if (found != Occlusion::none) record_.work.addDimmed();
        if (found == Occlusion::opaque) record_.work.addHit();
        return found;
    }

    /// The first triangle that a traversal meets, not the closest one.
    Hit anyHit(const Ray& ray, const RayFilter& filter) const {
        return ray.enters ? search(ray, &filter, true).occluder : Hit::none(ray.tMax);
    }

    /// All triangles that a prepared ray hits before its tMax, in the order of (t, id).
    std::vector<Hit> allHits(const Ray& ray, const RayFilter& filter) const {
        std::vector<Hit> hits;
        if (!ray.enters) return hits;
        search(ray, &filter, false, 0, &hits);
        std::sort(hits.begin(), hits.end(),
                  [](const Hit& one, const Hit& other) { return other.isReplacedBy(one.t, one.id); });
        return hits;
    }

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
        Hit occluder;           ///< that ended the search of a shadow ray
        std::vector<Hit>* hits; ///< of a ray that wants all, and keeps its tMax

        bool isOver() const { return occlusion == Occlusion::opaque; }
    };

    /// Traces a prepared ray from a root, by default the scene's.
    TraceState search(const Ray& ray, const RayFilter* filter, bool isShadow, std::size_t instance = 0,
                      std::vector<Hit>* hits = nullptr) const {
        ++record_.counters.raysInBox;
        record_.work.enterBox();
        TraceState state{ray,    frame_.roots[instance], Hit::none(ray.tMax), isShadow,
                         filter, Occlusion::none,        Hit::none(ray.tMax), hits};
        run(state);
        return state;
    }

    /// The nearest hit of a ray of the world: the least (t, instance, id), t along that ray.
    Hit nearestOfInstances(const Ray& world, Hit best) const {
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
    Occlusion occlusionByInstances(const Ray& world) const {
        Occlusion occlusion = Occlusion::none;
        for (std::size_t i = 0; i < frame_.instances.size() && occlusion != Occlusion::opaque; ++i) {
            if (!instances::mayEnter(world, world.tMax, frame_.instances[i].box, numbers_)) continue;
            const ObjectRay object = instances::toObject(world, world.tMax, frame_.instances[i], numbers_);
            const Ray ray = prepareRay(object.request, instances::cube(numbers_), numbers_);
            if (ray.enters) occlusion = std::max(occlusion, search(ray, nullptr, true, i).occlusion);
        }
        return occlusion;
    }

    void run(TraceState& state) const {
        if (numbers_.bvh) hasNarrowBoxes(numbers_) ? traverse<std::int32_t>(state) : traverse<std::int64_t>(state);
        else
            for (std::size_t i = 0; (i == 0 || i < frame_.recordCount) && !state.isOver(); i += frame_.leafRecords())
                testRecord(state, i);
    }

    void testRecord(TraceState& state, std::size_t address) const {
        address &= memory_.addressMask();
        std::optional<LeafTriangles> other;
        const LeafTriangles* const found = memory_.leafAt(address, other);
        if (!found) {
            record_.errors.illegalRecord = true;
            return;
        }
        const LeafTriangles& leaf = *found;
        if (!faces_.isEmpty()) faces_.prefetchIndex(leafTriangles * address);
        record_.log.addRead(RayStep::Kind::record, address);
        record_.work.addLeaf(address, leaf.count);
        for (int i = 0; i < leaf.count; ++i) {
            ++record_.counters.triangleTests;
            Hit hit = state.best;
            const std::uint64_t id = leafTriangles * address + static_cast<std::uint64_t>(i);
            const std::array<Vector, 3> vertices = leaf.verticesOf(i);
            bool crossesTriangle = false;
            const bool isHit =
                testTriangle(state.ray, vertices, id, numbers_, hit, record_.work.isOn() ? &crossesTriangle : nullptr);
            if (crossesTriangle) record_.work.addCrossed(i);
            record_.log.addTriangle(vertices, id, isHit);
            hit.isClear = leaf.isClear;
            if (!isHit || (state.filter && !state.filter->accepts(hit, leaf))) continue;
            if (!faces_.isEmpty()) faces_.prefetchRecord(id);
            if (state.hits) {
                state.hits->push_back(hit);
                continue;
            }
            if (!state.isShadow) {
                state.best = hit;
                continue;
            }
            if (!state.isOver()) state.occluder = hit;
            state.occlusion =
                std::max(state.occlusion,
                         hit.isClear && frame_.lighting.hasTransmittance ? Occlusion::transmissive : Occlusion::opaque);
        }
    }

    template <class Integer> __attribute__((flatten)) void traverse(TraceState& state) const {
        const Hit& best = state.best;
        const BoxTests<Integer> boxes(state.ray, numbers_);
        std::array<StackEntry, 256> stack;
        std::size_t depth = 0;
        Node other;
        std::uint64_t nodeVisits = 0;
        StackEntry next{false, static_cast<std::uint32_t>(state.root), 0};
        std::int64_t limit = tMaxUnits(best.t, numbers_);
        for (bool busy = !record_.errors.watchdog; busy;) {
            busy = false;
            if (next.isLeaf) {
                testRecord(state, next.address);
                if (state.isOver()) return;
                limit = tMaxUnits(best.t, numbers_);
            } else if (const Node* const found = memory_.nodeAt(next.address, other); !found) {
                record_.errors.illegalRecord = true;
            } else {
                // A node visit takes at least one cycle
                if (frame_.watchdogCycles != 0 && ++nodeVisits > frame_.watchdogCycles) {
                    record_.errors.watchdog = true;
                    return;
                }
                ++record_.counters.nodeReads;
                const Node& node = *found;
                memory_.prefetch(node.first);
                std::array<Entered, nodeChildren> entered;
                int count = 0;
                record_.counters.boxTests += node.isLegal ? static_cast<std::uint64_t>(node.children()) : 0;
                if (node.isLegal) count = boxes.test(node, limit, entered);
                else record_.errors.illegalRecord = true;
                if (record_.log.isOn()) logNode(next.address, node, entered, count);
                record_.work.addNode(next.address, count);
                for (int i = count - 1; i > 0; --i) {
                    const StackEntry entry = entryOf(node, entered[i]);
                    if (depth < static_cast<std::size_t>(numbers_.stackDepth)) stack[depth++] = entry;
                    else record_.errors.stackOverflow = true;
                }
                record_.counters.deepestStack = std::max<std::uint64_t>(record_.counters.deepestStack, depth);
                if (count > 0) {
                    next = entryOf(node, entered[0]);
                    busy = true;
                }
            }
            while (!busy && depth > 0) {
                next = stack[--depth];
                busy = next.tNear <= limit;
                if (!busy) record_.work.addDropped();
            }
        }
    }

    void logNode(std::uint32_t address, const Node& node, const std::array<Entered, nodeChildren>& entered,
                 int count) const {
        record_.log.addRead(RayStep::Kind::node, address);
        for (int slot = 0; node.isLegal && slot < node.children(); ++slot) {
            const bool isHit = std::any_of(entered.begin(), entered.begin() + count,
                                           [slot](const Entered& child) { return child.slot == slot; });
            record_.log.addChild(node, slot, entryOf(node, {slot, 0}).address, isHit);
        }
    }

    StackEntry entryOf(const Node& node, const Entered& child) const {
        const auto slot = static_cast<std::uint32_t>(child.slot), nodes = std::uint32_t{node.nodes};
        const bool isLeaf = slot >= nodes;
        const std::uint32_t offset =
            isLeaf ? nodes + (slot - nodes) * static_cast<std::uint32_t>(frame_.leafRecords()) : slot;
        return {isLeaf, (node.first + offset) & memory_.addressMask(), child.tNear};
    }

    const Numbers& numbers_;
    const ColumnMemory& memory_;
    const Frame& frame_;
    TraceRecord& record_;
    FaceTable faces_;
};

/// Finds the hits of prepared rays. Copies share the column memory.
class Tracer : public TraceRecord {
public:
    /// See `SceneSearch`.
    Hit trace(const Ray& ray) { return search().trace(ray); }
    Occlusion occlusion(const Ray& ray) { return search().occlusion(ray); }

protected:
    Tracer(const Numbers& numbers, const std::map<std::string, Layout>& layouts)
        : numbers_(numbers), memory_(std::make_shared<ColumnMemory>(layouts, numbers)) {}

    Numbers numbers_;
    std::shared_ptr<ColumnMemory> memory_;
    Frame frame_;

private:
    SceneSearch search() { return {numbers_, *memory_, frame_, *this}; }
};

} // namespace colonnade
