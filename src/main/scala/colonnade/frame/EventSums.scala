package colonnade.frame

import chisel3._
import chisel3.util.log2Ceil
import colonnade.config.ColonnadeConfig
import colonnade.formats.{Gather, NodeRecord}
import colonnade.unit.AttributeFetch

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
