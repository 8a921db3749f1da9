// unit/PathUnit.scala with the fetch of attributes, shader and colour unit: follows the path of each pixel of a column.
#pragma once
#include <vector>

#include "bounces.hpp"
#include "environment.hpp"
#include "ray_generator.hpp"
#include "ray_setup.hpp"
#include "record_fetch.hpp"

namespace colonnade::cycles {

/// What a frame's registers mean for its cycles.
struct FrameSettings {
    int lights, gatherBounces;
    bool hasEnvironment, isMapCamera;
};

class PathUnit {
public:
    PathUnit(const Design& design, const FrameWork& work, const FrameSettings& settings, CellChannel& cells)
        : design_(design), work_(work), settings_(settings), paths_(static_cast<std::size_t>(design.pathContexts)),
          free_(design.isLarge()), ended_(design.isLarge()), next_(design.isLarge()), last_(design.isLarge()),
          done_(design.isLarge()), camera_(design.isLarge()), others_(design.isLarge()), resumable_(design.isLarge()),
          generator_(design), setup_(design), slots_(std::min(16, design.pathContexts)),
          fetch_(design, design.rows, slots_, std::min(2, design.recordBuffers)), bounces_(design),
          pixelQueue_(design.isLarge() ? 3 : 1), environment_(design, cells) {
        idleCount_ = design.pathContexts;
        for (int i = 0; i < design.pathContexts; ++i) idle_.add(i);
    }

    /// The ray that ray set-up offers to the traversal units, or misses the box: the context of its path, or -1; its
    /// step.
    int offeredRay(Cycle now) const { return setup_.offered(now); }
    std::uint32_t stepOf(int path) const { return at(path).ray; }

    bool acceptsPosition(Cycle) const { return freeNow_ >= 0 && generator_.isReady(rayLeavesGenerator_); }

    /// The first half of a cycle: what depends on registers alone.
    void begin(Cycle now) {
        freeNow_ = free_.now(idle_);
        endedNow_ = ended_.now(resolve_);
        nextNow_ = next_.now(shadowTest_);
        lastNow_ = last_.now(ending_);
        doneNow_ = done_.now(complete_);
        if (settings_.hasEnvironment) {
            cameraNow_ = camera_.now(fromCamera_);
            othersNow_ = others_.now(pending_);
            resumeNow_ = resumable_.now(resumes_);
        }
        offers_ = setup_.offered(now);
        const PathStep* const ray = offers_ >= 0 ? &work_.steps[at(offers_).ray] : nullptr;
        missesBox_ = ray && !ray->isInBox;
    }

    bool missesBox() const { return missesBox_; }

    /// Whether the generator's ray enters ray set-up: known once ray set-up and the other sources are.
    void arbitrate(Cycle now, bool rayLeaves) {
        raySent_ = rayLeaves;
        // Into the queue in front of ray set-up: rays from surfaces, from bounces, from the camera
        const bool hasPlace = requests_.count() < 2;
        shadowFires_ = hasPlace && hasShadow_;
        bounceFires_ = hasPlace && !hasShadow_ && bounced_.has(now);
        const bool waitsForBounce = bounced_.has(now);
        generatorBypasses_ = settings_.hasEnvironment && generator_.hasRay() &&
                             work_.steps[at(generator_.ray()).step].kind == PathStep::Kind::lookup;
        rayLeavesGenerator_ = generator_.hasRay() && !(settings_.hasEnvironment && waitsForBounce) &&
                              (generatorBypasses_ || (hasPlace && !shadowFires_ && !waitsForBounce));
    }

    /// A pixel that is accepted: its index, -1 for none; its place; it is of a tile of the object.
    struct Position {
        std::int64_t index = -1;
        unsigned x = 0, y = 0;
        bool inObjectTile = true;
    };

    /// A pixel of a tile of the environment leaves.
    bool environmentLeaves() const { return environmentLeaves_; }

    /// The rest of a cycle. `result`: the path whose trace has ended, or -1; `pixelLeaves`: the pixel that waits is
    /// taken.
    void step(Cycle now, const Broadcasts& broadcasts, const Position& pixel, int result, bool pixelLeaves) {
        const std::int64_t position = pixel.index;
        const int phase = static_cast<int>(now % 3);
        idleContexts += static_cast<std::uint64_t>(idleCount_);
        contextsRaySetup += static_cast<std::uint64_t>(inSetup_);
        inSetup_ += static_cast<int>(position >= 0) - static_cast<int>(raySent_);

        // Retire a pixel
        bool retires = doneNow_ >= 0 && pixels_ + static_cast<int>(isFinished_) < pixelQueue_;
        pixels_ += static_cast<int>(isFinished_) - static_cast<int>(pixelLeaves);
        isFinished_ = retires;
        environmentLeaves_ = retires && !at(doneNow_).inObjectTile;

        // The colour of a path is complete, or it goes on; one that waits for its ratio gives way
        int coloured = -1;
        for (auto* colours : {&colours_, &ratios_}) {
            if (coloured >= 0 || !colours->has(now)) continue;
            coloured = colours->front();
            colours->pop();
        }

        // A path ends
        const bool colourIsFree = now >= colourOpens_;
        const bool endFires = lastNow_ >= 0 && colourIsFree;

        // Shadow rays and rays that gather
        const bool shadowReady = !isHeld_ || !hasShadow_;
        const bool shadowMoves = isHeld_ && (!hasShadow_ || shadowFires_);
        const bool issues = nextNow_ >= 0 && shadowReady;

        // Ray set-up takes the oldest request
        const bool setupReady = setup_.isReady(now, raySent_);
        const int entering = setupReady && !requests_.isEmpty() ? requests_.front() : -1;

        // Attributes
        bool leafReady = phase == 1 && decoding_ < decoderPlaces;
        const RecordFetch::Grant before = grant_;
        waitRecord += static_cast<std::uint64_t>(__builtin_popcount(fetch_.pending()));
        waitUnit += static_cast<std::uint64_t>(__builtin_popcount(fetch_.ready()) + (before.context >= 0));
        contextsShading += static_cast<std::uint64_t>(inShader_);
        grant_ = fetch_.step(broadcasts, design_.banks, {false, leafReady, design_.hasColours});
        std::int64_t decodes = -1;
        int freedSlot = -1, again = again_, againKind = againKind_;
        again_ = -1;
        if (before.context >= 0) {
            Slot& slot = slot_[static_cast<std::size_t>(before.context)];
            const PathStep& surface = work_.steps[at(slot.path).step];
            if (before.kind == RecordKind::colours) {
                slot.hasColours = true;
                again_ = before.context, againKind_ = 1;
            } else if (surface.hasColours && design_.hasColours && !slot.hasColours) {
                again_ = before.context, againKind_ = 2;
            } else {
                decodes = slot.path;
                freedSlot = before.context;
            }
        }
        // The record of a slot is requested through a queue
        if (fetch_.requests() && recordRequests_.count() < 2) {
            recordRequests_.push(fetch_.requested());
            fetch_.accept();
        }
        if (again >= 0) {
            const std::uint32_t leaf = work_.steps[at(slot_[static_cast<std::size_t>(again)].path).step].first;
            fetch_.begin(again, againKind == 2 ? RecordKind::colours : RecordKind::leaf,
                         againKind == 2 ? leaf + 1 : leaf);
        }
        if (!hits_.isEmpty() && hits_.front().at <= now && usedSlots_ != (1u << slots_) - 1) {
            const int slot = __builtin_ctz(~usedSlots_), path = hits_.front().value;
            hits_.pop();
            usedSlots_ |= 1u << slot;
            slot_[static_cast<std::size_t>(slot)] = {path, false};
            fetch_.begin(slot, RecordKind::leaf, work_.steps[at(path).step].first);
        }
        if (freedSlot >= 0) usedSlots_ &= ~(1u << freedSlot);

        // The decoder of leaves, and the entry of the shader in every third cycle
        if (decodes >= 0) {
            faces_.push(now + 19, static_cast<int>(decodes));
            ++decoding_;
        }
        enterShader(now, phase);

        // Shaded surfaces
        int lit = -1;
        if (lit_.has(now)) {
            --inShader_;
            lit = lit_.front();
            lit_.pop();
        }

        // Registers: the states of contexts
        free_.end(position >= 0);
        ended_.end(true);
        next_.end(issues);
        last_.end(endFires);
        done_.end(retires);
        if (retires) {
            complete_.remove(doneNow_);
            idle_.add(doneNow_);
            ++idleCount_;
        }
        if (coloured >= 0) afterColour(now, coloured);
        if (endFires) {
            ending_.remove(lastNow_);
            takeEnd(now, lastNow_);
        }
        if (hasShadow_ && shadowFires_) {
            requests_.push(shadowPath_);
            hasShadow_ = false;
        }
        if (shadowMoves) {
            hasShadow_ = true;
            shadowPath_ = heldPath_;
            isHeld_ = false;
        }
        if (issues) {
            shadowTest_.remove(nextNow_);
            ++inSetup_;
            isHeld_ = true;
            heldPath_ = nextNow_;
            Path& path = at(nextNow_);
            path.ray = ++path.step;
            path.hasGathered = path.hasGathered || work_.steps[path.step].isGathered;
        }
        if (entering >= 0) requests_.pop();
        if (bounceFires_) {
            const int path = bounced_.front().path;
            inShader_ -= bounced_.front().isFromShader;
            bounced_.pop();
            ++inSetup_;
            at(path).ray = ++at(path).step;
            requests_.push(path);
        }
        if (rayLeavesGenerator_) {
            if (generatorBypasses_) {
                fromCamera_.add(generator_.ray());
                --inSetup_;
            } else requests_.push(generator_.ray());
        }
        setup_.step(now, raySent_, entering, entering >= 0 ? &work_.steps[at(entering).ray] : nullptr);
        if (raySent_ && missesBox_) resolve_.add(offers_);
        if (result >= 0) resolve_.add(result);
        if (endedNow_ >= 0) {
            resolve_.remove(endedNow_);
            afterTrace(now, endedNow_);
        }
        if (lit >= 0) afterShading(lit);
        finishBounces(now);
        if (settings_.hasEnvironment) stepEnvironment(now);
        if (position >= 0) {
            Path& path = at(freeNow_);
            path.isStraight = true;
            path.inObjectTile = pixel.inObjectTile;
            path.isOfRoom = path.hasGathered = path.isInFresnel = path.goesBack = path.isShadowed = false;
            path.step = path.ray = work_.pixels[static_cast<std::size_t>(position)];
            path.end = work_.pixels[static_cast<std::size_t>(position) + 1];
            idle_.remove(freeNow_);
            --idleCount_;
        }
        generator_.step(rayLeavesGenerator_, position >= 0, freeNow_, pixel.x, pixel.y, pixel.inObjectTile);
    }

    /// A finished pixel waits.
    bool hasPixel() const { return pixels_ > 0; }

    bool requests() const { return !recordRequests_.isEmpty(); }
    std::uint32_t requested() const { return recordRequests_.front(); }
    void accept() { recordRequests_.pop(); }

    std::uint64_t idleContexts = 0, busyShader = 0, contextsRaySetup = 0, contextsShading = 0, waitRecord = 0,
                  waitUnit = 0, raysEnvironment = 0;
    std::uint64_t busyEnvironment() const { return environment_.busy; }
    std::uint64_t snoopHits() const { return fetch_.snoopHits; }
    std::uint64_t busySetup() const { return setup_.busy; }

private:
    struct Path {
        std::uint32_t step = 0, ray = 0, end = 0;
        /// It has left no surface of the object; it is at a point of the environment, that of its pixel; it has
        /// gathered, and goes back there; its Fresnel reflection is resolved.
        bool isStraight = true, isOfRoom = false, hasGathered = false, goesBack = false, isInFresnel = false,
             isShadowed = false, inObjectTile = true;
    };
    struct Slot {
        int path;
        bool hasColours;
    };

    static constexpr int decoderPlaces = 8;
    static constexpr Cycle faceAwayCycles = 9;

    Path& at(int path) { return paths_[static_cast<std::size_t>(path)]; }
    const Path& at(int path) const { return paths_[static_cast<std::size_t>(path)]; }
    bool hasNext(const Path& path) const { return path.step + 1 < path.end; }
    const PathStep& nextOf(const Path& path) const { return work_.steps[path.step + 1]; }

    /// unit/RtController.scala: where a path goes behind a ray that has ended, or an occlusion test that shows its hit.
    void afterTrace(Cycle now, int index) {
        Path& path = at(index);
        const PathStep& ray = work_.steps[path.step];
        if (ray.kind == PathStep::Kind::ray && ray.isShadow) {
            path.isShadowed = path.isShadowed || (ray.isDimmed && path.isOfRoom && path.isStraight);
            return afterLights(index);
        }
        const bool goesOn = hasNext(path);
        if (goesOn && nextOf(path).kind == PathStep::Kind::surface) {
            ++path.step;
            if (path.isOfRoom) path.isStraight = false;
            hits_.push({now + 2, index});
        } else if (goesOn && nextOf(path).kind == PathStep::Kind::lookup) wait(index);
        else if (path.isOfRoom) ending_.add(index); // what the point gathers has missed the object: the point is lit
        else if (path.isStraight) complete_.add(index);
        else ending_.add(index);
    }

    /// The path waits for the environment.
    void wait(int index) {
        Path& path = at(index);
        ++path.step;
        (path.isStraight ? fromCamera_ : pending_).add(index);
    }

    void afterShading(int index) {
        Path& path = at(index);
        if (path.goesBack) ending_.add(index);
        else afterLights(index);
    }

    void afterLights(int index) {
        Path& path = at(index);
        const bool isRay = hasNext(path) && nextOf(path).kind == PathStep::Kind::ray;
        if (path.isInFresnel) resumes_.add(index);
        else if (isRay && (nextOf(path).isShadow || (nextOf(path).isGathered && path.isOfRoom))) shadowTest_.add(index);
        else ending_.add(index);
    }

    void afterColour(Cycle now, int index) {
        Path& path = at(index);
        if (hasNext(path)) {
            // It gathers
            path.isStraight = false;
            shadowTest_.add(index);
        } else if (path.isOfRoom && path.hasGathered && !path.goesBack && !path.isStraight) {
            path.goesBack = true;
            offerPoint(now, index);
        } else complete_.add(index);
    }

    /// A point of the environment waits for the shader.
    void offerPoint(Cycle, int index) { points_.add(index); }

    void stepEnvironment(Cycle now) {
        // A ray from the camera goes first, if it is accepted
        const bool directIsOpen = settings_.isMapCamera ? environment_.acceptsDirect() : environment_.acceptsMarch();
        const bool isCamera = cameraNow_ >= 0 && directIsOpen,
                   isOther = !isCamera && othersNow_ >= 0 && environment_.acceptsMarch();
        const int request = isCamera ? cameraNow_ : isOther ? othersNow_ : -1;
        camera_.end(isCamera);
        others_.end(isOther);
        if (isCamera) fromCamera_.remove(cameraNow_);
        if (isOther) pending_.remove(othersNow_);
        raysEnvironment += request >= 0;
        const bool stores = rayLeavesGenerator_ || bounceFires_;
        const int answered =
            environment_.step(now, request, request >= 0 ? &work_.steps[at(request).step] : nullptr, work_, stores);
        if (answered >= 0) {
            Path& path = at(answered);
            const PathStep& lookup = work_.steps[path.step];
            path.isInFresnel = lookup.isReflection;
            if (lookup.isHit) {
                if (path.isStraight) path.isOfRoom = true;
                offerPoint(now, answered);
            } else if (lookup.isTest) resolve_.add(answered);
            else if (lookup.isReflection) resumes_.add(answered);
            else if (path.isStraight) complete_.add(answered);
            else ending_.add(answered);
        }

        // Deferred bounces
        const bool resumes = resumeNow_ >= 0 && now >= resumeOpens_;
        resumable_.end(resumes);
        if (resumes) {
            resumes_.remove(resumeNow_);
            at(resumeNow_).isInFresnel = false;
            resumeOpens_ = now + 3;
            issueBounce(now + 2, resumeNow_, false);
        }
    }

    /// shading/ColourUnit.scala takes a path; a shadowed pixel of the environment needs ShadowRatios.scala, for one
    /// pixel at a time.
    void takeEnd(Cycle now, int index) {
        const Path& path = at(index);
        const Cycle slots = slotsOf(index);
        const bool needsRatio =
            path.isOfRoom && (path.isStraight || path.goesBack) && (path.isShadowed || path.goesBack);
        const Cycle starts = std::max(now + 1, needsRatio ? ratioOpens_ : 0);
        colourOpens_ = starts + std::max<Cycle>(slots, 2) - 1;
        if (!needsRatio) return colours_.push(starts + slots + 6, index);
        ratioOpens_ = starts + slots + 13;
        ratios_.push(starts + slots + 15, index);
    }

    /// Slots of the colour unit: three channels of each light, or of the background.
    int slotsOf(int index) const {
        const Path& path = at(index);
        const PathStep& step = work_.steps[path.step];
        const bool isRay = step.kind == PathStep::Kind::ray;
        const bool isLit = isRay                                  ? step.isShadow || path.isOfRoom
                           : step.kind == PathStep::Kind::surface ? step.material == PathStep::Material::diffuse
                                                                  : step.isHit;
        return 3 * (isLit ? lightsOn() : 1) + (hasNext(path) ? 3 : 0);
    }

    void enterShader(Cycle now, int phase) {
        if (design_.isSequentialShader) return enterSequentialShader(now);
        // A light of the hit in the entry has entered
        if (phase == 1) takesFace_ = lightsLeft_ == 0 && bounces_.hasPlace() && faces_.has(now);
        if (phase != 2 && settings_.hasEnvironment) choosePoint(false);
        if (phase != 2) return;
        const bool takesPoint = !takesFace_ && isOffered_ && lightsLeft_ == 0 && bounces_.hasPlace();
        if (settings_.hasEnvironment) choosePoint(takesPoint);
        if (takesPoint) {
            lightsLeft_ = lightsOn() - 1;
            lit_.push(now + design_.shadeLight + 3 + 3 * lightsLeft_, chosenBefore_);
            busyShader += 3;
            ++inShader_;
        } else if (takesFace_) {
            const int path = takeFace();
            busyShader += 3;
            if (isDiffuse(path)) {
                lightsLeft_ = lightsOn() - 1;
                lit_.push(now + design_.shadeLight + 3 + 3 * lightsLeft_, path);
            } else {
                bounces_.push(now + 12, path, surfaceOf(path));
            }
        } else if (lightsLeft_ > 0) {
            --lightsLeft_;
            busyShader += 3;
        }
    }

    /// shading/SequentialShader.scala: the geometry of a hit, then root and quotient of each light that the surface
    /// faces.
    void enterSequentialShader(Cycle now) {
        const bool takesPoint = !takesFace_ && isOffered_ && now >= shaderOpens_;
        if (settings_.hasEnvironment) choosePoint(takesPoint);
        if (takesPoint) {
            ++inShader_;
            shaderOpens_ = now + design_.geometryCycles + 20 * (lightsOn() - 1);
            lit_.push(shaderOpens_ + design_.cosineCycles, chosenBefore_);
        } else if (takesFace_) {
            const int path = takeFace();
            const Cycle geometry = design_.geometryCycles + 20 * (lightsOn() - 1);
            busyShader += static_cast<std::uint64_t>(geometry);
            shaderOpens_ = now + geometry;
            const bool isFacing = hasNext(at(path)) && nextOf(at(path)).isShadow;
            if (isDiffuse(path)) lit_.push(shaderOpens_ + (isFacing ? design_.cosineCycles : faceAwayCycles), path);
            else bounces_.push(shaderOpens_, path, surfaceOf(path));
        }
        takesFace_ = now + 1 >= shaderOpens_ && faces_.has(now) && !bounces_.isBlocked(now);
    }

    /// One of the points that wait in the table is offered, unless the table is read for a request.
    void choosePoint(bool isTaken) {
        const bool offers = !environment_.isTaken() && chosenPoint_ >= 0 && !isTaken;
        chosenBefore_ = chosenPoint_;
        if (chosenPoint_ < 0 || isTaken) {
            const int last = chosenPoint_;
            chosenPoint_ = points_.first(last);
            if (isTaken) points_.remove(last);
        }
        isOffered_ = offers;
    }

    int takeFace() {
        takesFace_ = false;
        const int path = faces_.front();
        faces_.pop();
        --decoding_;
        ++inShader_;
        return path;
    }

    int lightsOn() const { return std::max(1, settings_.lights); }
    const PathStep& surfaceOf(int path) const { return work_.steps[at(path).step]; }
    bool isDiffuse(int path) const { return surfaceOf(path).material == PathStep::Material::diffuse; }

    /// Mirrors and glass.
    void finishBounces(Cycle now) {
        const int index = bounces_.step(now);
        if (index < 0) return;
        Path& path = at(index);
        path.isStraight = false;
        if (settings_.hasEnvironment && hasNext(path) && nextOf(path).isReflection) {
            --inShader_;
            wait(index);
        } else issueBounce(now, index, true);
    }

    /// The next ray of a path that bounces, or its end.
    void issueBounce(Cycle now, int index, bool isFromShader) {
        Path& path = at(index);
        const bool isTraced = hasNext(path) && nextOf(path).kind == PathStep::Kind::ray;
        if (isFromShader && !isTraced) --inShader_;
        if (isTraced) bounced_.push(now + 1, {index, isFromShader});
        else if (hasNext(path)) wait(index);
        else ending_.add(index);
    }

    const Design& design_;
    const FrameWork& work_;
    const FrameSettings& settings_;
    std::vector<Path> paths_;
    Set idle_, resolve_, shadowTest_, ending_, complete_, fromCamera_, pending_, resumes_, points_;
    Choice free_, ended_, next_, last_, done_, camera_, others_, resumable_;
    int freeNow_ = -1, endedNow_ = -1, nextNow_ = -1, lastNow_ = -1, doneNow_ = -1, offers_ = -1, cameraNow_ = -1,
        othersNow_ = -1, resumeNow_ = -1;
    int idleCount_, inSetup_ = 0, inShader_ = 0;
    bool missesBox_ = false, raySent_ = false, rayLeavesGenerator_ = false, shadowFires_ = false, bounceFires_ = false,
         generatorBypasses_ = false, isOffered_ = false;
    int chosenPoint_ = -1, chosenBefore_ = -1;
    Cycle resumeOpens_ = 0;
    RayGenerator generator_;
    RaySetup setup_;
    Ring<int, 4> requests_;
    bool isHeld_ = false, hasShadow_ = false;
    int heldPath_ = -1, shadowPath_ = -1;
    int slots_;
    RecordFetch fetch_;
    RecordFetch::Grant grant_;
    std::array<Slot, 16> slot_{};
    std::uint32_t usedSlots_ = 0;
    int again_ = -1, againKind_ = 0;
    Ring<std::uint32_t, 4> recordRequests_;
    struct Hit {
        Cycle at;
        int value;
    };
    Ring<Hit, 1024> hits_;
    Delayed<int, 16> faces_;
    int decoding_ = 0, lightsLeft_ = 0;
    bool takesFace_ = false;
    struct Bounced {
        int path;
        bool isFromShader;
    };
    Delayed<int, 256> lit_;
    Delayed<Bounced, 256> bounced_;
    Bounces bounces_;
    Delayed<int, 64> colours_, ratios_;
    Cycle colourOpens_ = 0, ratioOpens_ = 0, shaderOpens_ = 0;
    int pixels_ = 0, pixelQueue_;
    bool isFinished_ = false, environmentLeaves_ = false;
    Environment environment_;
};

} // namespace colonnade::cycles
