// The device as coupled Verilator models of unit, parts of a column, column and device.
// simulator_sources.py, which writes coupling.hpp, explains the coupling and the properties of the RTL that it needs.
#pragma once
#include <cstdint>
#include <cstring>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "VColonnade.h"
#include "VColonnade___024root.h"
#include "VColumnModel.h"
#include "VColumnModel___024root.h"
#include "VUnitModel.h"
#include "VUnitModel___024root.h"
#include "coupling.hpp"
#include "still.hpp"
#ifdef WAVEFORM
#include "verilated_vcd_c.h"
#endif

/// Copies or compares a port between `variables` of the outer model and the `inner` model.
#define INWARD(port) inner.port = *variables.port;
#define OUTWARD(port) *variables.port = inner.port;
#define REQUIRE_EQUAL(port) requireEqual(*variables.port, inner.port, #port);
#define DIFFERS(port) | differs(*variables.port, inner.port)
#define ANY_DIFFERS(ports) (false ports(DIFFERS))

template <class Value> bool differs(const Value& outer, const Value& inner) {
    return std::memcmp(&outer, &inner, sizeof outer) != 0;
}

template <class Value> void requireEqual(const Value& outer, const Value& inner, const char* port) {
    if (differs(outer, inner)) throw std::runtime_error(std::string("the simulator's models disagree on port ") + port);
}

inline void flip(CData& event) { event = !event; }

/// A part of a column. `emit` gives its outputs to the column, and `take` also gets its inputs: they return whether the
/// column has to settle again.
#define PART(name) \
    struct name##Part { \
        name##Variables variables; \
        Still<V##name##Model> model; \
        bool emit() { \
            const V##name##Model& inner = *model; \
            if (model.isStill() || !ANY_DIFFERS(name##_OUTPUTS)) return false; \
            model.changed(); \
            name##_OUTPUTS(OUTWARD) flip(*variables.event); \
            return true; \
        } \
        bool take(bool isDeaf) { \
            V##name##Model& inner = *model; \
            if (!(ANY_DIFFERS(name##_INPUTS) | ANY_DIFFERS(name##_DIRECT) | ANY_DIFFERS(name##_REGISTERS)) || \
                (isDeaf && model.isStill())) \
                return false; \
            model.wake(); \
            name##_INPUTS(INWARD) name##_DIRECT(INWARD) name##_REGISTERS(INWARD) flip(inner.take); \
            inner.eval(); \
            return emit(); \
        } \
        void check() { \
            V##name##Model& inner = *model; \
            if (!model.isStill()) { \
                flip(inner.take); \
                inner.eval(); \
            } \
            name##_INPUTS(REQUIRE_EQUAL) name##_DIRECT(REQUIRE_EQUAL) name##_REGISTERS(REQUIRE_EQUAL) \
                name##_OUTPUTS(REQUIRE_EQUAL) model.check(#name); \
        } \
    };
EACH_PART(PART)
#undef PART

/// The parts of a column. `run` calls a function with each.
struct Parts {
    explicit Parts(VColumnModel___024root& root) {
#define BIND(name) \
    for (const auto& variables : bind##name(root)) name##s.push_back({variables, {}});
        EACH_PART(BIND)
#undef BIND
        (void)root;
    }

    template <class Function> void each(Function run) {
#define RUN(name) \
    for (auto& part : name##s) run(part);
        EACH_PART(RUN)
#undef RUN
        (void)run;
    }

#define MEMBER(name) std::vector<name##Part> name##s;
    EACH_PART(MEMBER)
#undef MEMBER
};

class Array {
public:
    /// The top model. Set its inputs before `settle`, read its outputs after it.
    VColonnade device;

    /// @param isDeaf A fault for tests: what sleeps hears no input
    explicit Array(bool isDeaf = false) : columnVariables_(bindColumn(*device.rootp)), isDeaf_(isDeaf) {
        for (std::size_t i = 0; i < columnVariables_.size(); ++i) {
            columns_.push_back(std::make_unique<VColumnModel>());
            for (const UnitVariables& variables : bindUnit(*columns_.back()->rootp)) {
                unitVariables_.push_back(variables);
                units_.emplace_back();
                units_.back()->eval();
            }
            parts_.emplace_back(*columns_.back()->rootp);
            parts_.back().each([](auto& part) { part.model->eval(); });
            columns_.back()->eval();
        }
        for (std::size_t i = 0; i < units_.size(); ++i) { // also constants
            const UnitVariables& variables = unitVariables_[i];
            VUnitModel& inner = *units_[i];
            Unit_INPUTS(INWARD)
        }
    }
    ~Array() {
        for (auto& unit : units_) unit->final();
        for (Parts& parts : parts_) parts.each([](auto& part) { part.model->final(); });
        for (auto& column : columns_) column->final();
        device.final();
    }

    /// Propagates all combinational values of this cycle.
    void settle() {
        device.eval();
        bool isNew = false;
        for (std::size_t i = 0; i < columns_.size(); ++i) {
            settleColumn(i, intoColumn(i) | outOfUnits(i));
            const ColumnVariables& variables = columnVariables_[i];
            const VColumnModel& inner = *columns_[i];
            if (!ANY_DIFFERS(Column_OUTPUTS)) continue;
            Column_OUTPUTS(OUTWARD)
            isNew = true;
        }
        if (isNew) {
            flip(*columnVariables_.front().event);
            device.eval();
        }
        for (std::size_t i = 0; i < columns_.size(); ++i)
            if (intoColumn(i)) settleColumn(i, true);
        for (std::size_t i = 0; i < units_.size(); ++i) {
            const UnitVariables& variables = unitVariables_[i];
            VUnitModel& inner = *units_[i];
            if (!ANY_DIFFERS(Unit_DIRECT) || (isDeaf_ && units_[i].isStill())) continue;
            units_[i].wake();
            Unit_DIRECT(INWARD)
        }
    }

    /// The clock edge after `settle`. Frame registers are copied only while they may change.
    void edge(bool mayChangeRegisters) {
        outerEdge(mayChangeRegisters);
        unitsEdge(mayChangeRegisters);
    }

    /// A cycle of device and columns without the units: for loads, which do not affect idle units.
    void outerCycle() {
        device.eval();
        for (std::size_t i = 0; i < columns_.size(); ++i) settleColumn(i, intoColumn(i));
        outerEdge(true);
    }

    /// A clock edge of the units alone, to catch up with cycles of `outerCycle`.
    void unitsEdge(bool mayChangeRegisters) {
        for (std::size_t i = 0; i < units_.size(); ++i) {
            const UnitVariables& variables = unitVariables_[i];
            VUnitModel& inner = *units_[i];
            bool isNew = ANY_DIFFERS(Unit_INPUTS);
            if (mayChangeRegisters) isNew |= ANY_DIFFERS(Unit_REGISTERS);
            if (isNew && !(isDeaf_ && units_[i].isStill())) {
                units_[i].wake();
                Unit_INPUTS(INWARD)
                if (mayChangeRegisters) { Unit_REGISTERS(INWARD) }
            }
            units_[i].edge();
        }
    }

    /// Writes a record into the memory of each column, as the load port does. Addresses beyond the depth are ignored.
    void store(std::uint64_t address, const void* record, std::size_t bytes) {
        for (auto& column : columns_) {
            unsigned bank = 0;
#define STORE(memory) storeInBank(column->rootp->memory, bank++, address, record, bytes);
            RECORD_BANKS(STORE)
#undef STORE
        }
    }

    /// No unit or part sleeps.
    void stayAwake() {
        for (auto& unit : units_) unit.stayAwake();
        for (Parts& parts : parts_) parts.each([](auto& part) { part.model.stayAwake(); });
    }

    /// Throws if another evaluation after `settle` changes a coupled port, or what sleeps.
    void check() {
        for (std::size_t i = 0; i < units_.size(); ++i) {
            const UnitVariables& variables = unitVariables_[i];
            VUnitModel& inner = *units_[i];
            if (!units_[i].isStill()) inner.eval();
            Unit_OUTPUTS(REQUIRE_EQUAL)
        }
        for (std::size_t i = 0; i < columns_.size(); ++i) {
            const ColumnVariables& variables = columnVariables_[i];
            VColumnModel& inner = *columns_[i];
            flip(inner.take);
            flip(inner.takeRegisters);
            flip(*unitVariables_[i * unitsOfColumn()].event);
            parts_[i].each([](auto& part) { flip(*part.variables.event); });
            inner.eval();
            parts_[i].each([](auto& part) { part.check(); });
            Column_OUTPUTS(REQUIRE_EQUAL)
            Column_REGISTERS(REQUIRE_EQUAL)
        }
        for (std::size_t i = 0; i < units_.size(); ++i) {
            const UnitVariables& variables = unitVariables_[i];
            const VUnitModel& inner = *units_[i];
            Unit_DIRECT(REQUIRE_EQUAL)
            Unit_INPUTS(REQUIRE_EQUAL)
            Unit_REGISTERS(REQUIRE_EQUAL)
            units_[i].check("a traversal unit");
        }
    }

#ifdef WAVEFORM
    /// Adds the device, its first column and that column's first unit to a waveform before it is opened.
    void addTo(VerilatedVcdC& waveform) {
        device.trace(&waveform, 99);
        columns_.front()->trace(&waveform, 99);
        units_.front()->trace(&waveform, 99);
        units_.front().stayAwake(); // its free-running counters are seen
    }

    /// Evaluates again what `addTo` adds: after `settle`, some of its inputs are newer than its other signals.
    void settleTraced() {
        columns_.front()->eval();
        units_.front()->eval();
    }
#endif

private:
    std::size_t unitsOfColumn() const { return units_.size() / columns_.size(); }

    /// Gives the device's outputs but frame registers to a column; returns whether one has changed.
    bool intoColumn(std::size_t i) {
        const ColumnVariables& variables = columnVariables_[i];
        VColumnModel& inner = *columns_[i];
        if (!(ANY_DIFFERS(Column_DIRECT) | ANY_DIFFERS(Column_INPUTS))) return false;
        Column_DIRECT(INWARD)
        Column_INPUTS(INWARD)
        flip(inner.take);
        return true;
    }

    /// Gives the outputs of a column's units to it; returns whether one has changed.
    bool outOfUnits(std::size_t column) {
        bool isNew = false;
        for (std::size_t i = column * unitsOfColumn(); i < (column + 1) * unitsOfColumn(); ++i) {
            const UnitVariables& variables = unitVariables_[i];
            const VUnitModel& inner = *units_[i];
            if (units_[i].isStill() || !ANY_DIFFERS(Unit_OUTPUTS)) continue;
            units_[i].changed();
            Unit_OUTPUTS(OUTWARD)
            isNew = true;
        }
        if (isNew) flip(*unitVariables_[column * unitsOfColumn()].event);
        return isNew;
    }

    /// Evaluates a column if an input is new, and its parts whose inputs change, until none does.
    void settleColumn(std::size_t i, bool isNew) {
        parts_[i].each([&](auto& part) { isNew |= part.emit(); });
        do {
            if (isNew) columns_[i]->eval();
            isNew = false;
            parts_[i].each([&](auto& part) { isNew |= part.take(isDeaf_); });
        } while (isNew);
    }

    void outerEdge(bool mayChangeRegisters) {
        clock(device);
        for (std::size_t i = 0; i < columns_.size(); ++i) {
            const ColumnVariables& variables = columnVariables_[i];
            VColumnModel& inner = *columns_[i];
            // Before the edge: the column passes them on to its units
            if (mayChangeRegisters && ANY_DIFFERS(Column_REGISTERS)) {
                Column_REGISTERS(INWARD)
                flip(inner.takeRegisters);
                settleColumn(i, true);
            }
            clock(inner);
            parts_[i].each([](auto& part) { part.model.edge(); });
        }
    }

    template <class Model> static void clock(Model& model) {
        flip(model.clock);
        model.eval();
    }

    template <class Memory> static void storeInBank(Memory& memory, unsigned bank, std::uint64_t address,
                                                    const void* record, std::size_t bytes) {
        if (address % banksOfColumn != bank) return;
        const std::uint64_t row = address / banksOfColumn;
        if (row < sizeof memory / sizeof memory[0]) std::memcpy(&memory[row], record, bytes);
    }

    std::vector<std::unique_ptr<VColumnModel>> columns_;
    std::vector<Still<VUnitModel>> units_;
    std::vector<Parts> parts_; // of each column
    std::vector<ColumnVariables> columnVariables_;
    std::vector<UnitVariables> unitVariables_;
    bool isDeaf_;
};

#undef INWARD
#undef OUTWARD
#undef REQUIRE_EQUAL
#undef DIFFERS
#undef ANY_DIFFERS
