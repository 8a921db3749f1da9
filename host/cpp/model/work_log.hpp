// What a frame asks of the device's units, pixel by pixel in the order of each path: the input of the cycle model
// (cpp/cycles).
#pragma once
#include <cstdint>
#include <vector>

#include "environment_view.hpp"

namespace colonnade {

/// A record that a ray visits. `dropped`: stack entries beyond its tMax that it pops behind the record. Of a node
/// `children` are entered, `triangles` is 0. Of a leaf `crossed` has a bit for each of its `triangles` that the ray's
/// line crosses.
struct RecordVisit {
    std::uint32_t address;
    std::uint8_t children, dropped, triangles, crossed;
};

/// A step of a path.
///
/// `ray`: it visits `count` records, the first of which is `first`; `isInBox`: it enters the object's box; `isHit`: of
/// a shadow ray, something opaque ends it; `isDimmed`: of a shadow ray, it meets anything. `surface`: the leaf `first`
/// is fetched, with its companion if `hasColours`, and its hit is shaded; `material`; of mirrors and glass
/// `isRefraction`, and whether the hit `isBehind`. `lookup`: `first` is its march's; `isDirect`: by the pipeline of
/// directly seen pixels, in a tile of one plane if `isFlat`; `isHit`: a point is found and shaded; `isTest`: it may
/// hide a hit, and `isHit` tells that it does; `isReflection`: of a Fresnel reflection, whose bounce waits.
struct PathStep {
    enum class Kind : std::uint8_t { ray, surface, lookup };
    enum class Material : std::uint8_t { diffuse, mirror, glass };
    Kind kind;
    Material material = Material::diffuse;
    bool isShadow : 1, isGathered : 1, isInBox : 1, isHit : 1, hasColours : 1, isDirect : 1, isTest : 1,
        isReflection : 1, isDimmed : 1, isRefraction : 1, isBehind : 1, isFlat : 1;
    std::uint32_t first = 0, count = 0;

    explicit PathStep(Kind kind)
        : kind(kind), isShadow(false), isGathered(false), isInBox(false), isHit(false), hasColours(false),
          isDirect(false), isTest(false), isReflection(false), isDimmed(false), isRefraction(false), isBehind(false),
          isFlat(false) {}
};

/// The work of a frame: the steps of pixel i are those from `pixels[i]` on to `pixels[i + 1]`.
struct FrameWork {
    std::vector<std::uint32_t> pixels;
    std::vector<PathStep> steps;
    std::vector<RecordVisit> visits;
    std::vector<MarchWork> marches;
};

/// Notes the work of a frame, or nothing. It changes no result.
class WorkLog {
public:
    /// Work goes to the end of `work`; null: nowhere.
    void writeTo(FrameWork* work) { work_ = work; }
    bool isOn() const { return work_ != nullptr; }

    void beginPixel() const {
        if (isOn()) work_->pixels.push_back(static_cast<std::uint32_t>(work_->steps.size()));
    }

    void addRay(bool isShadow, bool isGathered) const {
        if (!isOn()) return;
        PathStep step(PathStep::Kind::ray);
        step.isShadow = isShadow;
        step.isGathered = isGathered;
        step.first = static_cast<std::uint32_t>(work_->visits.size());
        work_->steps.push_back(step);
    }

    /// The last ray enters the object's box.
    void enterBox() const {
        if (isOn()) work_->steps.back().isInBox = true;
    }

    void addNode(std::size_t address, int children) const {
        if (isOn()) addVisit({static_cast<std::uint32_t>(address), static_cast<std::uint8_t>(children), 0, 0, 0});
    }

    void addLeaf(std::size_t address, int triangles) const {
        if (isOn()) addVisit({static_cast<std::uint32_t>(address), 0, 0, static_cast<std::uint8_t>(triangles), 0});
    }

    /// The last ray's line crosses a triangle of the last record.
    void addCrossed(int triangle) const { work_->visits.back().crossed |= static_cast<std::uint8_t>(1 << triangle); }

    void addDropped() const {
        if (isOn() && work_->visits.back().dropped != 255) ++work_->visits.back().dropped;
    }

    /// The last ray has hit something; of a shadow ray, something opaque.
    void addHit() const {
        if (isOn()) work_->steps.back().isHit = true;
    }

    /// The last ray, a shadow ray, has met something.
    void addDimmed() const {
        if (isOn()) work_->steps.back().isDimmed = true;
    }

    void addSurface(std::uint64_t leaf, PathStep::Material material, bool hasColours) const {
        if (!isOn()) return;
        PathStep step(PathStep::Kind::surface);
        step.material = material;
        step.hasColours = hasColours;
        step.first = static_cast<std::uint32_t>(leaf);
        work_->steps.push_back(step);
    }

    /// The last surface is that of a bounce.
    void addBounce(bool isRefraction, bool isBehind) const {
        if (!isOn()) return;
        work_->steps.back().isRefraction = isRefraction;
        work_->steps.back().isBehind = isBehind;
    }

    void addLookup(bool isDirect, const MarchWork& march, bool isHit) const {
        if (!isOn()) return;
        PathStep step(PathStep::Kind::lookup);
        step.isDirect = isDirect;
        step.isFlat = march.cells == 0;
        step.isHit = isHit;
        step.first = static_cast<std::uint32_t>(work_->marches.size());
        if (!isDirect) work_->marches.push_back(march);
        work_->steps.push_back(step);
    }

    /// The last lookup decides whether the environment hides a hit.
    void testsHit(bool isHidden) const {
        if (!isOn()) return;
        work_->steps.back().isTest = true;
        work_->steps.back().isHit = isHidden;
    }

    /// The next lookup is a Fresnel reflection's: the number of steps before it.
    std::size_t position() const { return isOn() ? work_->steps.size() : 0; }
    void isReflectionAt(std::size_t position) const {
        if (isOn() && position < work_->steps.size()) work_->steps[position].isReflection = true;
    }

private:
    void addVisit(const RecordVisit& visit) const {
        ++work_->steps.back().count;
        work_->visits.push_back(visit);
    }

    FrameWork* work_ = nullptr;
};

} // namespace colonnade
