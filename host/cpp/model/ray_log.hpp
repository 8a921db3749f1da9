// What the rays of a pixel did, step by step, for explanation (docs/browser.md). The log changes no result.
#pragma once
#include <vector>

#include "ray_setup.hpp"

namespace colonnade {

/// Kinds of rays, by the counters that count them.
enum class RayKind { primary, shadow, reflection, refraction, gather };

/// A step. Positions are in the object's space, vertex units.
struct RayStep {
    enum class Kind { ray, node, child, record, triangle, hit };
    Kind kind;
    /// `ray`: its kind. `node`, `record`: the address that is read. `child`: the address of the child. `triangle`,
    /// `hit`: the packed id.
    std::int32_t value;
    /// `child`: whether the ray enters it. `triangle`: whether it is the closest hit so far.
    bool isHit;
    /// `child`: whether it is a record of triangles.
    bool isLeaf;
    /// `ray`: origin and direction. `child`: both corners of its box. `triangle`: its vertices. `hit`: t, grid steps.
    std::array<double, 9> values;
};

/// A log of steps, or none.
class RayLog {
public:
    /// Steps go to the end of `steps`; null: nowhere.
    void writeTo(std::vector<RayStep>* steps) { steps_ = steps; }
    bool isOn() const { return steps_ != nullptr; }
    void add(RayStep step) const { steps_->push_back(step); }

    void addRay(RayKind kind, const RayRequest& request, const Numbers& n) const {
        if (!isOn()) return;
        RayStep step{RayStep::Kind::ray, static_cast<std::int32_t>(kind), false, false, {}};
        const double unit = static_cast<double>(std::int64_t(1) << std::max(0, n.gridFraction)) /
                            static_cast<double>(std::int64_t(1) << std::max(0, -n.gridFraction));
        for (int axis = 0; axis < 3; ++axis) {
            step.values[axis] = static_cast<double>(request.origin[axis]) / unit;
            step.values[3 + axis] = static_cast<double>(request.direction[axis]);
        }
        add(step);
    }

    void addRead(RayStep::Kind kind, std::size_t address) const {
        if (isOn()) add({kind, static_cast<std::int32_t>(address), false, false, {}});
    }

    void addChild(const Node& node, int slot, std::uint32_t address, bool isHit) const {
        RayStep step{RayStep::Kind::child, static_cast<std::int32_t>(address), isHit, slot >= node.nodes, {}};
        for (int axis = 0; axis < 3; ++axis) {
            step.values[axis] =
                static_cast<double>(node.origin[axis] + (std::int64_t(node.low[axis][slot]) << node.exponent[axis]));
            step.values[3 + axis] =
                static_cast<double>(node.origin[axis] + (std::int64_t(node.high[axis][slot]) << node.exponent[axis]));
        }
        add(step);
    }

    void addTriangle(const std::array<Vector, 3>& vertices, std::uint64_t id, bool isHit) const {
        if (!isOn()) return;
        RayStep step{RayStep::Kind::triangle, static_cast<std::int32_t>(id), isHit, false, {}};
        for (int i = 0; i < 9; ++i) step.values[i] = static_cast<double>(vertices[i / 3][i % 3]);
        add(step);
    }

    void addHit(std::uint64_t id, double t) const {
        if (isOn()) add({RayStep::Kind::hit, static_cast<std::int32_t>(id), true, false, {t}});
    }

private:
    std::vector<RayStep>* steps_ = nullptr;
};

} // namespace colonnade
