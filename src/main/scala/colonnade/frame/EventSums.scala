package colonnade.frame

import chisel3._
import chisel3.util.log2Ceil
import colonnade.config.ColonnadeConfig
import colonnade.environment.MarchSums
import colonnade.formats.AttributeEvents

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
  private def perUnit             = sum(units)
  private def perContext          = sum(units * config.array.contexts + columns * config.units.pathContexts)
  private def perMarch            = sum(columns * config.mapRequesters)
  private def perEnvironment      = ifEnvironment(sum(columns))

  private def ifEnvironment[T <: Data](event: T): Option[T] = if (config.hasEnvironment) Some(event) else None

  /** Including background pixels, which bypass the units. */
  val raysPrimary      = sum(units + columns)
  val raysShadow       = perUnit
  val raysReflection   = perUnit
  val raysRefraction   = perUnit
  val raysInBox        = perUnit
  val nodeReads        = perUnit
  val boxTests         = sum(units * config.geometry.arity)
  val triangleTests    = perUnit
  val hits             = perUnit
  val recordReads      = sum(columns * config.columnBvhMemory.banks)
  val snoopHits        = perContext
  val bankConflicts    = sum(columns * config.recordRequesters)
  val cacheMisses      = config.columnBvhMemory.cache.map(_ => sum(columns * config.columnBvhMemory.banks))
  val busyRaySetup     = perUnit
  val busyBoxUnit      = perUnit
  val busyTriangleUnit = sum(units * config.units.triangleLanes)
  val busyShader       = perUnit

  val idleContexts      = perContext
  val contextsRaySetup  = perContext
  val waitRecord        = perContext
  val waitUnit          = perContext
  val contextsBox       = perContext
  val contextsTriangles = perContext
  val contextsShading   = perContext

  /** With an environment. */
  val raysEnvironment     = ifEnvironment(perUnit)
  val marchSteps          = ifEnvironment(perMarch)
  val busyEnvironment     = ifEnvironment(perMarch)
  val contextsEnvironment = ifEnvironment(perContext)

  val albedoReads = perEnvironment
  val normalReads = perEnvironment
  val cellReads   = perEnvironment
  val planeReads  = perEnvironment

  /** A level, not an event: the maximum of all units. */
  val deepestStack = UInt(log2Ceil(config.columnBvhMemory.stackDepth + 1).W)

  /** Errors in any unit. */
  val stackOverflow = Bool()
  val illegalRecord = Bool()
}

object EventSums {

  /** The events of a column: its started pixels, its units, its controller, the environment's maps and shared marches. */
  def ofColumn(
      config:      ColonnadeConfig,
      raysPrimary: UInt,
      units:       Seq[Record],
      controller:  ColumnBvhEvents,
      environment: Option[AttributeEvents],
      marches:     Option[MarchSums]
  ): EventSums = {
    val sums = joined(new EventSums(config, 1), units.map(_.elements.toMap))
    sums.raysPrimary   := raysPrimary
    sums.recordReads   := controller.recordReads
    sums.bankConflicts := controller.bankConflicts
    sums.cacheMisses.zip(controller.cacheMisses).foreach { case (sum, misses) => sum := misses }
    for (events <- environment; (name, event) <- events.elements) sums.elements(name) := event
    for (events <- marches) {
      sums.marchSteps.get      := events.marchSteps
      sums.busyEnvironment.get := events.busyEnvironment
      sums.illegalRecord := tree(units.map(_.elements("illegalRecord").asUInt))(_ | _).asBool || events.illegalRecord
    }
    sums
  }

  /** The events of the array, from those of its columns. */
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
