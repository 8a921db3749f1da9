// A frame of the device, cycle by cycle: tiles, columns and the scene's memory.
#pragma once
#include <memory>
#include <stdexcept>

#include "path_unit.hpp"
#include "scene_memory.hpp"
#include "simulation.hpp"
#include "traversal_unit.hpp"

namespace colonnade::cycles {

/// The kinds of tiles, and of pixels.
enum class PixelKind : std::uint8_t { background, environment, object };

/// frame/TileScan.scala: the cells of a grid in Morton order.
class MortonScan {
public:
    explicit MortonScan(int levels) : levels_(levels) {}

    bool isBusy() const { return isBusy_; }
    unsigned x() const { return compact(code_); }
    unsigned y() const { return compact(code_ >> 1); }
    bool isInside() const { return isBusy_ && x() < wide_ && y() < high_; }

    /// The last code is passed in this cycle.
    bool isLast() const {
        const unsigned next = code_ + (isInside() ? 1 : block());
        return next >> (2 * levels_) || (!isInside() && code_ == 0);
    }
    void start(unsigned wide, unsigned high) { isBusy_ = true, wide_ = wide, high_ = high, code_ = 0; }
    void step() {
        const bool last = isLast();
        code_ += isInside() ? 1 : block();
        isBusy_ = !last;
    }

private:
    /// The largest block that starts at a code outside.
    unsigned block() const {
        for (int level = 0; level < levels_; ++level)
            if (code_ >> (2 * level) & 3) return 1u << (2 * level);
        return 1u << (2 * levels_);
    }
    static unsigned compact(unsigned code) {
        unsigned result = 0;
        for (int bit = 0; bit < 12; ++bit) result |= (code >> (2 * bit) & 1) << bit;
        return result;
    }

    int levels_;
    bool isBusy_ = false;
    unsigned wide_ = 0, high_ = 0, code_ = 0;
};

struct TilePosition {
    unsigned x, y;
};

/// frame/TileScheduler.scala: the tiles of a kind in Morton order, to the columns in turn.
class TileScheduler {
public:
    /// `size`: of a tile, pixels; `divides`: tiles are handed out as sixteenths (frame/TileScheduler.scala).
    TileScheduler(PixelKind kind, int levels, unsigned size, bool divides)
        : kind_(kind), divides_(divides), size_(size), scan_(levels) {}

    void start(unsigned width, unsigned height) {
        width_ = width, height_ = height;
        scan_.start((width + size_ - 1) / size_, (height + size_ - 1) / size_);
    }
    bool hasTile() const { return !queue_.isEmpty(); }
    const TilePosition& tile() const { return queue_.front(); }
    bool isIdle() const { return !scan_.isBusy() && !hasFirst_ && !hasSecond_ && queue_.isEmpty(); }

    /// The column that takes the tile, of those that are ready, or -1.
    int grant(std::uint32_t ready) { return queue_.isEmpty() ? -1 : arbiter_.grant(ready); }

    template <class KindOf> void step(int taken, const KindOf& kindOf) {
        const bool hasPlace = queue_.count() < 4;
        if (taken >= 0) {
            arbiter_.take(taken);
            queue_.pop();
        }
        bool leaves = false;
        if (hasSecond_) {
            if (kindOf(second_) != kind_) leaves = true;
            else {
                const unsigned parts = divides_ ? 16 : 1, edge = size_ / 4;
                const TilePosition square{second_.x * size_ + edge * ((part_ & 1) | (part_ >> 1 & 2)),
                                          second_.y * size_ + edge * ((part_ >> 1 & 1) | (part_ >> 2 & 2))};
                const bool isInside = square.x < width_ && square.y < height_;
                if (isInside && hasPlace) queue_.push(square);
                if (!isInside || hasPlace) part_ = part_ + 1 == parts ? 0 : part_ + 1;
                leaves = (!isInside || hasPlace) && part_ == 0;
            }
        }
        const bool second = !hasSecond_ || leaves, first = !hasFirst_ || second;
        if (second) hasSecond_ = hasFirst_, second_ = first_;
        if (first) hasFirst_ = scan_.isInside(), first_ = {scan_.x(), scan_.y()};
        if (scan_.isBusy() && (!scan_.isInside() || first)) scan_.step();
    }

private:
    PixelKind kind_;
    bool divides_;
    unsigned size_, width_ = 0, height_ = 0, part_ = 0;
    MortonScan scan_;
    bool hasFirst_ = false, hasSecond_ = false;
    TilePosition first_{}, second_{};
    Ring<TilePosition, 4> queue_;
    RoundRobin arbiter_;
};

/// A column with its walkers.
class Column {
public:
    Column(const Design& design, const FrameWork& work, const FrameSettings& settings, CellChannel& cells,
           unsigned width, unsigned height, const std::vector<PixelKind>& kinds)
        : design_(design), hasEnvironment_(settings.hasEnvironment), width_(width), height_(height), kinds_(kinds),
          scan_(log2(design.tileSize)), backgroundScan_(log2(design.tileSize)), environmentScan_(log2(design.tileSize)),
          paths(design, work, settings, cells) {
        for (int row = 0; row < design.rows; ++row) units.emplace_back(design, work, row);
        for (int row = 0; row < design.rows; row += design.triangleRows)
            groups.emplace_back(design, std::min(design.triangleRows, design.rows - row));
        for (int bank = 0; bank < design.banks; ++bank) banks.emplace_back(design, bank);
    }

    bool takesObjectTile() const { return !scan_.isBusy() || (scan_.isLast() && (!scan_.isInside() || firstIsOpen())); }
    bool takesBackgroundTile() const {
        return !backgroundScan_.isBusy() ||
               (backgroundScan_.isLast() && (!backgroundScan_.isInside() || backgroundQueue_ < 2));
    }

    bool takesEnvironmentTile() const {
        return !environmentScan_.isBusy() ||
               (environmentScan_.isLast() && (!environmentScan_.isInside() || environmentQueue_.count() < 2));
    }

    /// The tiles that come in a cycle, or null.
    struct Tiles {
        const TilePosition *object = nullptr, *background = nullptr, *environment = nullptr;
    };

    /// A cycle; returns whether a pixel leaves.
    template <class AnnouncementOf> bool step(Cycle now, const Tiles& tiles, const AnnouncementOf& announced) {
        Broadcasts broadcasts{};
        for (std::size_t bank = 0; bank < banks.size(); ++bank) broadcasts[bank] = banks[bank].broadcast();

        // Path unit: choices; a ray to the bus; results of rays
        paths.begin(now);
        int target = -1;
        const int offered = paths.offeredRay(now);
        if (offered >= 0 && !paths.missesBox()) {
            std::uint32_t free = 0;
            for (std::size_t row = 0; row < units.size(); ++row)
                free |= static_cast<std::uint32_t>(units[row].isFree()) << row;
            target = rayBus_.grant(free & ~(busRow_ >= 0 ? 1u << busRow_ : 0));
            if (target >= 0) {
                rayBus_.take(target);
                ++raysInBox;
            }
        }
        const bool raySent = offered >= 0 && (paths.missesBox() || target >= 0);
        const int result = result_;
        std::uint32_t results = 0;
        for (std::size_t row = 0; row < units.size(); ++row)
            results |= static_cast<std::uint32_t>(units[row].hasResult()) << row;
        const int granted = resultBus_.grant(results);
        result_ = -1;
        if (granted >= 0) {
            resultBus_.take(granted);
            result_ = units[static_cast<std::size_t>(granted)].result();
            units[static_cast<std::size_t>(granted)].takeResult();
        }

        // Triangle groups, then traversal units
        for (std::size_t g = 0; g < groups.size(); ++g) {
            const std::size_t first = g * static_cast<std::size_t>(design_.triangleRows),
                              rows = static_cast<std::size_t>(groups[g].rows());
            Candidate candidate{};
            bool comes = false;
            std::uint32_t waits = 0;
            for (std::size_t i = 0; i < rows; ++i) {
                if (const Candidate* const sent = units[first + i].candidate()) {
                    candidate = *sent;
                    candidate.row = static_cast<std::int8_t>(i);
                    comes = true;
                }
                waits |= static_cast<std::uint32_t>(units[first + i].fetch.waitsForTriangles()) << i;
            }
            const RecordEnd end = groups[g].step(now, comes ? &candidate : nullptr, waits);
            for (std::size_t i = 0; i < rows; ++i) {
                TraversalUnit& unit = units[first + i];
                TraversalUnit::Arrival arrival;
                if (busRow_ == static_cast<int>(first + i)) arrival = arriving_;
                unit.step(now, broadcasts, arrival, end.row == static_cast<int>(i) ? end.context : -1,
                          groups[g].grantedRow() == static_cast<int>(i));
            }
        }
        busRow_ = target;
        if (target >= 0) arriving_ = {offered, paths.stepOf(offered)};

        // Positions and pixels
        paths.arbitrate(now, raySent);
        const bool accepts = hasPosition_ && paths.acceptsPosition(now);
        // The collector takes a pixel in each cycle, those that the walkers reject first
        const bool rejectedLeaves = !others_.isEmpty() || rejectsEnvironment();
        const bool pixelLeaves = !rejectedLeaves && paths.hasPixel();
        const bool backgroundLeaves = !rejectedLeaves && !pixelLeaves && backgroundQueue_ > 0;
        const bool environmentLeaves = paths.environmentLeaves();
        PathUnit::Position position;
        if (accepts)
            position = {static_cast<std::int64_t>(position_.y) * width_ + position_.x, position_.x, position_.y,
                        inObjectTile_};
        paths.step(now, broadcasts, position, result, pixelLeaves);
        walk(accepts, rejectedLeaves, backgroundLeaves, environmentLeaves, tiles);
        const bool leaves = isCollected_;
        isCollected_ = rejectedLeaves || pixelLeaves || backgroundLeaves;

        // Banks
        std::array<std::uint32_t, 4> requests{};
        for (int row = 0; row < design_.rows; ++row) {
            const RecordFetch& fetch = units[static_cast<std::size_t>(row)].fetch;
            if (fetch.requests()) requests[static_cast<std::size_t>(design_.bankOf(fetch.requested()))] |= 1u << row;
        }
        if (paths.requests())
            requests[static_cast<std::size_t>(design_.bankOf(paths.requested()))] |= 1u << design_.rows;
        for (std::size_t bank = 0; bank < banks.size(); ++bank) {
            std::uint32_t asking = requests[bank];
            int row = -1;
            std::uint32_t address = 0;
            if (asking && banks[bank].isReady()) {
                for (std::uint32_t rest = asking; rest; rest &= rest - 1)
                    if (banks[bank].isComing(addressOf(__builtin_ctz(rest)))) asking &= ~(rest & -rest);
                row = bankArbiters_[bank].grant(asking);
                if (row >= 0) {
                    bankArbiters_[bank].take(row);
                    address = addressOf(row);
                    ++recordReads;
                    bankConflicts += static_cast<std::uint64_t>(__builtin_popcount(asking) - 1);
                    if (row < design_.rows) units[static_cast<std::size_t>(row)].fetch.accept();
                    else paths.accept();
                }
            }
            banks[bank].step(now, row, address, announced(static_cast<int>(bank)));
        }
        return leaves;
    }

    static int log2(int value) { return 31 - __builtin_clz(static_cast<unsigned>(value)); }

private:
    std::uint32_t addressOf(int row) const {
        return row < design_.rows ? units[static_cast<std::size_t>(row)].fetch.requested() : paths.requested();
    }
    PixelKind kindAt(const TilePosition& p) const { return kinds_[static_cast<std::size_t>(p.y) * width_ + p.x]; }
    bool firstIsOpen() const { return !hasFirst_ || secondIsOpen(); }
    bool secondIsOpen() const { return !hasSecond_ || tested_.count() < 2; }

    void startScan(MortonScan& scan, TilePosition& origin, const TilePosition& tile, int edge) {
        origin = tile;
        const auto size = static_cast<unsigned>(edge);
        scan.start(std::min(size, width_ - tile.x), std::min(size, height_ - tile.y));
    }

    /// A pixel of a tile of the environment outside its window is rejected.
    bool rejectsEnvironment() const {
        return others_.isEmpty() && !environmentQueue_.isEmpty() &&
               kindAt(environmentQueue_.front()) == PixelKind::background;
    }

    /// frame/Walkers.scala and PixelCollector.scala.
    void walk(bool accepts, bool rejectedLeaves, bool backgroundLeaves, bool environmentLeaves, const Tiles& tiles) {
        // Pixels of the environment go first while few of them are in flight
        const bool isOpen = !hasPosition_ || accepts;
        const bool hadPlace = environmentQueue_.count() < 2, isRejected = rejectedLeaves && others_.isEmpty();
        if (accepts) hasPosition_ = false;
        bool isEnvironment = false;
        if (hasEnvironment_ && !environmentQueue_.isEmpty()) {
            isEnvironment = kindAt(environmentQueue_.front()) != PixelKind::background &&
                            environmentInFlight_ != std::max(1, design_.pathContexts / 2);
            if (isEnvironment && isOpen) {
                position_ = environmentQueue_.front();
                hasPosition_ = true;
                inObjectTile_ = false;
                ++environmentInFlight_;
                environmentQueue_.pop();
            } else if (isRejected) environmentQueue_.pop();
        }
        environmentInFlight_ -= environmentLeaves;

        // Behind the test: a pixel for the path unit, or another one
        const bool first = firstIsOpen(), second = secondIsOpen(), testedIsOpen = tested_.count() < 2;
        const std::size_t othersBefore = others_.count();
        if (!tested_.isEmpty()) {
            const TilePosition pixel = tested_.front();
            const bool forUnits = kindAt(pixel) != PixelKind::background;
            if (forUnits ? isOpen && !isEnvironment : othersBefore < 64) {
                tested_.pop();
                if (forUnits) {
                    position_ = pixel;
                    hasPosition_ = inObjectTile_ = true;
                } else others_.push(pixel);
            }
        }
        if (rejectedLeaves && !isRejected) others_.pop();
        if (hasSecond_ && testedIsOpen) tested_.push(second_);
        if (second) hasSecond_ = hasFirst_, second_ = first_;
        if (first) hasFirst_ = scan_.isInside(), first_ = {origin_.x + scan_.x(), origin_.y + scan_.y()};
        if (scan_.isBusy() && (!scan_.isInside() || first)) scan_.step();
        if (tiles.object)
            startScan(scan_, origin_, *tiles.object, hasEnvironment_ ? design_.tileSize / 4 : design_.tileSize);

        if (environmentScan_.isInside() && hadPlace)
            environmentQueue_.push(
                {environmentOrigin_.x + environmentScan_.x(), environmentOrigin_.y + environmentScan_.y()});
        if (environmentScan_.isBusy() && (!environmentScan_.isInside() || hadPlace)) environmentScan_.step();
        if (tiles.environment) startScan(environmentScan_, environmentOrigin_, *tiles.environment, design_.tileSize);

        const bool queueOpen = backgroundQueue_ < 2;
        if (backgroundLeaves) --backgroundQueue_;
        if (backgroundScan_.isInside() && queueOpen) ++backgroundQueue_;
        if (backgroundScan_.isBusy() && (!backgroundScan_.isInside() || queueOpen)) backgroundScan_.step();
        if (tiles.background) startScan(backgroundScan_, backgroundOrigin_, *tiles.background, design_.tileSize);
    }

    const Design& design_;
    bool hasEnvironment_, inObjectTile_ = true;
    unsigned width_, height_;
    const std::vector<PixelKind>& kinds_;
    MortonScan scan_, backgroundScan_, environmentScan_;
    int environmentInFlight_ = 0;
    Ring<TilePosition, 4> environmentQueue_;
    TilePosition origin_{}, backgroundOrigin_{}, environmentOrigin_{}, first_{}, second_{}, position_{};
    bool hasFirst_ = false, hasSecond_ = false, hasPosition_ = false, isCollected_ = false;
    Ring<TilePosition, 4> tested_;
    Ring<TilePosition, 128> others_;
    int backgroundQueue_ = 0;
    RoundRobin rayBus_, resultBus_;
    int busRow_ = -1, result_ = -1;
    TraversalUnit::Arrival arriving_;
    std::array<RoundRobin, 4> bankArbiters_;

public:
    std::vector<TraversalUnit> units;
    std::vector<TriangleGroup> groups;
    std::vector<ColumnBank> banks;
    PathUnit paths;
    std::uint64_t recordReads = 0, raysInBox = 0, bankConflicts = 0;
};

/// A frame.
class FrameSimulation {
public:
    FrameSimulation(const Design& design, const DramDesign& dram, const FrameWork& work, const FrameSettings& settings,
                    unsigned width, unsigned height, std::vector<PixelKind> kinds, std::vector<PixelKind> tiles)
        : design_(design), kinds_(std::move(kinds)), tiles_(std::move(tiles)), width_(width), height_(height),
          tilesWide_((width + static_cast<unsigned>(design.tileSize) - 1) / static_cast<unsigned>(design.tileSize)),
          schedulers_{
              TileScheduler(PixelKind::object, tileLevels(design), static_cast<unsigned>(design.tileSize),
                            settings.hasEnvironment),
              TileScheduler(PixelKind::background, tileLevels(design), static_cast<unsigned>(design.tileSize), false),
              TileScheduler(PixelKind::environment, tileLevels(design), static_cast<unsigned>(design.tileSize), false)},
          dram_(design, dram) {
        cells_.resize(static_cast<std::size_t>((design.columns + design.columnsPerCopy - 1) / design.columnsPerCopy));
        for (int i = 0; i < design.columns; ++i)
            columns_.push_back(std::make_unique<Column>(design_, work, settings,
                                                        cells_[static_cast<std::size_t>(i / design.columnsPerCopy)],
                                                        width, height, kinds_));
        if (design.hasCache)
            for (int bank = 0; bank < design.banks; ++bank)
                shared_.push_back(std::make_unique<SharedBank>(design_, bank));
    }

    CycleCounters run() {
        for (TileScheduler& scheduler : schedulers_) scheduler.start(width_, height_);
        std::uint64_t left = std::uint64_t(width_) * height_;
        Cycle now = 1, last = 0;
        for (; left > 0; ++now) {
            const int pixels = step(now);
            if (pixels > 0) last = now;
            if (now - last > maxCyclesWithoutPixel) throw std::runtime_error("the cycle model does not end");
            left -= static_cast<std::uint64_t>(pixels);
        }
        CycleCounters counters{{"cycles", now - 1}};
        const auto add = [&counters](const char* name, std::uint64_t count) {
            counters[name] += static_cast<std::int64_t>(count);
        };
        for (const auto& column : columns_) {
            add("raysInBox", column->raysInBox);
            add("recordReads", column->recordReads);
            add("bankConflicts", column->bankConflicts);
            for (const TraversalUnit& unit : column->units) {
                add("nodeReads", unit.nodes);
                add("busyBoxUnit", unit.busyBox);
                add("waitRecord", unit.waitRecord);
                add("waitUnit", unit.waitUnit);
                add("contextsBox", unit.contextsBox);
                add("contextsTriangles", unit.contextsTriangles);
                add("snoopHits", unit.fetch.snoopHits);
            }
            for (const TriangleGroup& group : column->groups) {
                add("triangleTests", group.tests);
                add("busyTriangleUnit", group.busy);
            }
            const PathUnit& paths = column->paths;
            add("idleContexts", paths.idleContexts);
            add("contextsRaySetup", paths.contextsRaySetup);
            add("contextsShading", paths.contextsShading);
            add("busyRaySetup", paths.busySetup());
            add("busyShader", paths.busyShader);
            if (design_.hasEnvironment) add("busyEnvironment", paths.busyEnvironment());
            add("waitRecord", paths.waitRecord);
            add("waitUnit", paths.waitUnit);
            add("snoopHits", paths.snoopHits());
            if (design_.hasCache)
                for (const ColumnBank& bank : column->banks) add("cacheMisses", bank.misses);
        }
        for (const auto& bank : shared_) add("dramReads", bank->dramReads);
        return counters;
    }

private:
    static int tileLevels(const Design& design) {
        return std::max(1, design.coordinateBits - Column::log2(design.tileSize));
    }

    int step(Cycle now) {
        const auto kindOf = [&](const TilePosition& tile) { return tiles_[tile.y * tilesWide_ + tile.x]; };
        std::array<int, kinds> taker;
        std::array<TilePosition, kinds> tile{};
        for (std::size_t kind = 0; kind < kinds; ++kind) {
            std::uint32_t ready = 0;
            if (schedulers_[kind].hasTile()) {
                tile[kind] = schedulers_[kind].tile();
                for (std::size_t i = 0; i < columns_.size(); ++i) {
                    const Column& column = *columns_[i];
                    ready |= static_cast<std::uint32_t>(kind == 0   ? column.takesObjectTile()
                                                        : kind == 1 ? column.takesBackgroundTile()
                                                                    : column.takesEnvironmentTile())
                             << i;
                }
            }
            taker[kind] = schedulers_[kind].grant(ready);
        }

        // What the shared cache announces is known before it moves
        int pixels = 0;
        for (std::size_t i = 0; i < columns_.size(); ++i) {
            for (std::size_t bank = 0; bank < shared_.size(); ++bank)
                announced_[bank] = shared_[bank]->announced(static_cast<int>(i));
            announcements_[i] = announced_;
        }
        if (!shared_.empty()) stepMemory(now);
        for (std::size_t i = 0; i < columns_.size(); ++i) {
            const auto of = [&](std::size_t kind) {
                return taker[kind] == static_cast<int>(i) ? &tile[kind] : nullptr;
            };
            pixels += columns_[i]->step(now, {of(0), of(1), of(2)}, [&](int bank) -> const Announcement& {
                return announcements_[i][static_cast<std::size_t>(bank)];
            });
        }
        for (std::size_t kind = 0; kind < kinds; ++kind) schedulers_[kind].step(taker[kind], kindOf);
        return pixels;
    }

    /// memory/DramReader.scala, and the banks of the shared cache.
    void stepMemory(Cycle now) {
        // A beat
        if (const int bank = dram_.offers(now); bank >= 0 && shared_[static_cast<std::size_t>(bank)]->takesBeat())
            shared_[static_cast<std::size_t>(bank)]->takeBeat(dram_.take(now));
        // An address, through a queue
        if (addressBank_ >= 0) dram_.read(now, addressBank_);
        std::uint32_t reads = 0;
        for (std::size_t bank = 0; bank < shared_.size(); ++bank)
            reads |= static_cast<std::uint32_t>(shared_[bank]->reads()) << bank;
        addressBank_ = addresses_.grant(reads);
        if (addressBank_ >= 0) {
            addresses_.take(addressBank_);
            shared_[static_cast<std::size_t>(addressBank_)]->takeRead();
        }
        for (std::size_t bank = 0; bank < shared_.size(); ++bank)
            shared_[bank]->step(
                [&](int column) -> ColumnBank& { return columns_[static_cast<std::size_t>(column)]->banks[bank]; });
    }

    const Design design_;
    std::vector<PixelKind> kinds_, tiles_;
    unsigned width_, height_, tilesWide_;
    std::vector<CellChannel> cells_; // of each copy of the maps
    std::vector<std::unique_ptr<Column>> columns_;
    std::vector<std::unique_ptr<SharedBank>> shared_;
    static constexpr std::size_t kinds = 3; // objects, backgrounds, environments
    static constexpr Cycle maxCyclesWithoutPixel = 1'000'000;
    std::array<TileScheduler, kinds> schedulers_;
    Dram dram_;
    RoundRobin addresses_;
    int addressBank_ = -1;
    std::array<Announcement, 4> announced_{};
    std::array<std::array<Announcement, 4>, 256> announcements_{};
};

} // namespace colonnade::cycles
