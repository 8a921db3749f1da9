package colonnade.config

import chisel3.util.log2Ceil

/** What a part of a column is built for: the device, and how many rays the part has in flight, one per context. A
  * module that no context concerns takes the device's configuration.
  */
sealed abstract class PartConfig {
  def device: ColonnadeConfig
  def contexts: Int

  final def numbers: NumberFormats = device.numbers

  /** With so many contexts a choice among them takes a cycle of its own. */
  final def isLarge: Boolean = contexts > ArrayConfig.maxContexts
}

/** The source of a column's rays, and the units that serve it: one context per pixel, or per ray of an application. */
final case class PathConfig(device: ColonnadeConfig) extends PartConfig {
  val contexts: Int = device.queries.fold(device.units.pathContexts)(_.contexts)
}

/** A traversal unit: one context per ray in flight. */
final case class TraversalConfig(device: ColonnadeConfig) extends PartConfig {
  val contexts: Int = device.array.contexts
}

/** The triangle units of a group of rows: the contexts of all its rows, whose number stands in front of the context. */
final case class TriangleGroupConfig(device: ColonnadeConfig) extends PartConfig {
  val contexts: Int =
    if (device.sharesTriangleUnits) device.array.contexts.max(2) << log2Ceil(device.units.triangleRows)
    else device.array.contexts
}

/** The fetch of attributes for a path unit: one context per awaited record.
  *
  * @param maxSlots    maximum number of awaited records
  * @param maxBuffers  maximum number of record buffers
  */
final case class AttributeFetchConfig(column: ColonnadeConfig, maxSlots: Int, maxBuffers: Int) extends PartConfig {
  val contexts: Int             = maxSlots.min(column.units.pathContexts)
  val device:   ColonnadeConfig = column.copy(columnBvhMemory =
    column.columnBvhMemory.copy(recordBuffers = maxBuffers.min(column.columnBvhMemory.recordBuffers))
  )
}
