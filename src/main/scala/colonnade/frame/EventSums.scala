package colonnade.frame

import chisel3._
import chisel3.util.log2Ceil
import colonnade.config.ColonnadeConfig
import colonnade.formats.{AttributeEvents, UnitEvents}

/** What happened in a column BVH controller in one cycle; names as in `Counters`. */
final class ColumnBvhEvents(config: ColonnadeConfig) extends Bundle {
  val recordReads = UInt(log2Ceil(config.columnBvhMemory.banks + 1).W)

  /** Requests that wait because the bank serves another row. */
  val bankConflicts = UInt(log2Ceil(config.array.rows + 1).W)
}

/** What happened in some columns in one cycle: sums over their units and controllers; names as in `Counters`. */
final class EventSums(config: ColonnadeConfig, columns: Int) extends Bundle {
  private val units = columns * config.array.rows

  private def sum(most: Int): UInt = UInt(log2Ceil(most + 1).W)
  private def perUnit              = sum(units)
  private def perContext           = sum(units * config.array.contexts)
  private def perRoom              = ifRoom(sum(columns))

  private def ifRoom[T <: Data](event: T): Option[T] = if (config.hasRoom) Some(event) else None

  /** With those of the background, which go past the units. */
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
  val bankConflicts    = perUnit
  val busyRaySetup     = perUnit
  val busyBoxUnit      = perUnit
  val busyTriangleUnit = sum(units * config.units.triangleLanes)
  val busyShader       = perUnit

  val idleContexts      = perContext
  val contextsSetUp     = perContext
  val waitRecord        = perContext
  val waitUnit          = perContext
  val contextsBox       = perContext
  val contextsTriangles = perContext
  val contextsShading   = perContext

  /** Where there is a room. */
  val raysRoom     = ifRoom(perUnit)
  val marchSteps   = ifRoom(perUnit)
  val busyRoom     = ifRoom(perUnit)
  val contextsRoom = ifRoom(perContext)

  val albedoReads = perRoom
  val normalReads = perRoom
  val cellReads   = perRoom
  val planeReads  = perRoom

  /** A level, not an event: the most of all units. */
  val deepestStack = UInt(log2Ceil(config.columnBvhMemory.stackDepth + 1).W)

  /** Errors in any unit. */
  val stackOverflow = Bool()
  val illegalRecord = Bool()
}

object EventSums {

  /** A column's, from the pixels it has begun and from those of its units, of its controller and of the room's maps. */
  def ofColumn(
      config:      ColonnadeConfig,
      raysPrimary: UInt,
      units:       Seq[UnitEvents],
      controller:  ColumnBvhEvents,
      room:        Option[AttributeEvents]
  ): EventSums = {
    val sums = joined(new EventSums(config, 1), units.map(_.elements.toMap))
    sums.raysPrimary                                                           := raysPrimary
    sums.recordReads                                                           := controller.recordReads
    sums.bankConflicts                                                         := controller.bankConflicts
    for (events <- room; (name, event) <- events.elements) sums.elements(name) := event
    sums
  }

  /** The array's, from those of its columns. */
  def ofArray(config: ColonnadeConfig, columns: Seq[EventSums]): EventSums =
    joined(new EventSums(config, columns.size), columns.map(_.elements.toMap))

  /** Joins what the parts have by the same name. */
  private def joined(result: EventSums, parts: Seq[Map[String, Data]]): EventSums = {
    val sums = Wire(result)
    for ((name, sum) <- sums.elements if parts.head.contains(name)) {
      val values = parts.map(_(name).asUInt)
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
