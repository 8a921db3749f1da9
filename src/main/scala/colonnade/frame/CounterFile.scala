package colonnade.frame

import chisel3._
import chisel3.util.{log2Ceil, ShiftRegister}
import colonnade.config.ColonnadeConfig
import colonnade.formats.{Counters, Gather, NodeRecord}
import colonnade.unit.AttributeFetch

final class CounterFileIO(config: ColonnadeConfig) extends Bundle {

  /** By column, delayed by one cycle. */
  val events = Input(Vec(config.array.columns, new EventSums(config, 1)))

  /** With a cache: lines that are read from DRAM, and whether a read failed. */
  val dramReads   = config.columnBvhMemory.cache.map(_ => Input(UInt(log2Ceil(config.columnBvhMemory.banks + 1).W)))
  val memoryError = config.columnBvhMemory.cache.map(_ => Input(Bool()))

  /** A frame starts; count the events of this cycle. */
  val clear      = Input(Bool())
  val isCounting = Input(Bool())

  val counters = Output(new Counters(config))

  /** Sticky until cleared. */
  val stackOverflow = Output(Bool())
  val illegalRecord = Output(Bool())
  val isMemoryError = config.columnBvhMemory.cache.map(_ => Output(Bool()))
}

/** The counters and sticky errors of the array, over the cycles of `isCounting`.
  *
  * They are complete [[CounterFile.settleCycles]] cycles after the last counted one. Sums pass one register in each
  * column and one here, so no path both crosses the array and adds.
  */
final class CounterFile(config: ColonnadeConfig) extends Module {
  import CounterFile._

  val io = IO(new CounterFileIO(config))

  private val counters = RegInit(0.U.asTypeOf(new Counters(config)))
  private val overflow = RegInit(false.B)
  private val illegal  = RegInit(false.B)
  private val events   = RegNext(EventSums.ofArray(config, io.events))

  // Levels and errors lag behind events; units reset theirs some cycles after a frame starts.
  private val countsEvents = ShiftRegister(io.isCounting, eventStages, false.B, true.B)
  private val countsLevels = ShiftRegister(countsEvents, levelStages, false.B, true.B)

  private val sums = events.elements.toMap -- levels
  private val held = counters.elements

  when(io.clear) {
    counters := 0.U.asTypeOf(counters)
    overflow := false.B
    illegal  := false.B
  }.otherwise {
    when(io.isCounting) { counters.cycles := counters.cycles + 1.U }
    when(countsEvents) { for ((name, sum) <- sums) { held(name) := held(name).asUInt + sum.asUInt } }
    when(countsLevels && events.deepestStack > counters.deepestStack) { counters.deepestStack := events.deepestStack }
    when(countsEvents || countsLevels) {
      overflow := overflow || events.stackOverflow
      illegal  := illegal || events.illegalRecord
    }
  }

  // Reads from DRAM come from no column. An error counts until the device is idle
  for (reads <- io.dramReads; counter <- counters.dramReads) {
    when(io.clear) { counter := 0.U }.elsewhen(countsEvents) { counter := counter + reads }
  }
  for (error <- io.memoryError; output <- io.isMemoryError) {
    val failed = RegInit(false.B)
    failed := !io.clear && (failed || error)
    output := failed
  }

  io.counters      := counters
  io.stackOverflow := overflow
  io.illegalRecord := illegal
}

object CounterFile {
  private val eventStages = 2 // pipeline registers of the sums of events
  private val levelStages = 2 // cycles by which a unit's levels may lag behind its events

  private val levels = Set("deepestStack", "stackOverflow", "illegalRecord")

  val settleCycles: Int = eventStages + levelStages + 1
}

/** Events of a column BVH controller in one cycle; names as in `Counters`. */
final class ColumnBvhEvents(config: ColonnadeConfig) extends Bundle {
  val recordReads = UInt(log2Ceil(config.columnBvhMemory.banks + 1).W)

  /** Requests that wait because the bank reads for another row. */
  val bankConflicts = UInt(log2Ceil(config.recordRequesters + 1).W)

  /** Reads that a cache answers later. */
  val cacheMisses = config.columnBvhMemory.cache.map(_ => UInt(log2Ceil(config.columnBvhMemory.banks + 1).W))
}

/** Events of some columns in one cycle, summed over their units and controllers; names as in `Counters`. */
final class EventSums(config: ColonnadeConfig, columns: Int) extends Bundle {
  private val units = columns * config.array.rows

  private def sum(max: Int): UInt = UInt(log2Ceil(max + 1).W)
  private def perColumn           = sum(columns)
  private def perUnit             = sum(units)
  private def perPath             = sum(columns * config.units.pathContexts)
  private def perTrace            = sum(units * config.array.contexts)
  private def perFetch            = sum(units * config.array.contexts + columns * AttributeFetch.slots)
  private def perMarch            = sum(columns * config.units.marches)

  private def ifEnvironment[T <: Data](event: T): Option[T] = if (config.hasEnvironment) Some(event) else None

  /** Including background pixels, which bypass the units. */
  val raysPrimary      = sum(2 * columns)
  val raysShadow       = perColumn
  val raysReflection   = perColumn
  val raysRefraction   = perColumn
  val raysInBox        = perUnit
  val nodeReads        = perUnit
  val boxTests         = sum(units * NodeRecord.most)
  val triangleTests    = perUnit
  val hits             = perColumn
  val recordReads      = sum(columns * config.columnBvhMemory.banks)
  val snoopHits        = perFetch
  val bankConflicts    = sum(columns * config.recordRequesters)
  val cacheMisses      = config.columnBvhMemory.cache.map(_ => sum(columns * config.columnBvhMemory.banks))
  val busyRaySetup     = perColumn
  val busyBoxUnit      = perUnit
  val busyTriangleUnit = sum(units * config.units.triangleLanes)
  val busyShader       = perColumn

  val idleContexts      = perPath
  val contextsRaySetup  = perPath
  val waitRecord        = perFetch
  val waitUnit          = perFetch
  val contextsBox       = perTrace
  val contextsTriangles = perTrace
  val contextsShading   = perPath

  /** With an environment. */
  val raysEnvironment     = ifEnvironment(perColumn)
  val marchSteps          = ifEnvironment(perMarch)
  val busyEnvironment     = ifEnvironment(perMarch)
  val contextsEnvironment = ifEnvironment(perPath)

  val albedoReads = ifEnvironment(perColumn)
  val normalReads = ifEnvironment(perColumn)
  val cellReads   = ifEnvironment(perColumn)
  val planeReads  = ifEnvironment(perColumn)

  /** With gathered light. */
  val raysGather = Gather(config).map(_ => perColumn)

  /** A level, not an event: the maximum of all units. */
  val deepestStack = UInt(log2Ceil(config.columnBvhMemory.stackDepth + 1).W)

  /** Errors in any unit. */
  val stackOverflow = Bool()
  val illegalRecord = Bool()
}

object EventSums {

  /** The events of a column: its started pixels, its controller, and its other parts. */
  def ofColumn(
      config:      ColonnadeConfig,
      raysPrimary: UInt,
      controller:  ColumnBvhEvents,
      parts:       Seq[Bundle]
  ): EventSums = {
    val sums = joined(new EventSums(config, 1), parts.map(_.elements.toMap))
    sums.raysPrimary   := raysPrimary
    sums.recordReads   := controller.recordReads
    sums.bankConflicts := controller.bankConflicts
    sums.cacheMisses.zip(controller.cacheMisses).foreach { case (sum, misses) => sum := misses }
    sums
  }

  /** The events of the array, from its columns' events. */
  def ofArray(config: ColonnadeConfig, columns: Seq[EventSums]): EventSums =
    joined(new EventSums(config, columns.size), columns.map(_.elements.toMap))

  /** Sums the fields of all parts by name. */
  private def joined(result: EventSums, parts: Seq[Map[String, Data]]): EventSums = {
    val sums = Wire(result)
    for ((name, sum) <- sums.elements if parts.exists(_.contains(name))) {
      val values = parts.flatMap(_.get(name)).map(_.asUInt)
      sum := (name match {
        case "deepestStack"                    => tree(values)((a, b) => Mux(a > b, a, b))
        case "stackOverflow" | "illegalRecord" => tree(values)(_ | _)
        case _                                 => tree(values)(_ +& _)
      })
    }
    sums
  }

  private def tree(values: Seq[UInt])(join: (UInt, UInt) => UInt): UInt =
    if (values.size == 1) values.head
    else {
      val (left, right) = values.splitAt(values.size / 2)
      join(tree(left)(join), tree(right)(join))
    }
}
