package colonnade.unit

import chisel3._
import chisel3.util.{RegEnable, Valid}
import colonnade.common.ContextTable
import colonnade.config.{NumberFormats, PathConfig}
import colonnade.formats.InstanceNumber
import colonnade.instance.WorldDistance
import colonnade.shading.Occlusion
import colonnade.traversal.TriangleHit

final class InstanceResultsIO(config: PathConfig) extends Bundle {
  val count = Input(UInt(NumberFormats.bitLength(config.device.frame.instances).W))

  /** A ray goes to the traversal units, or misses an object's cube. */
  val visited = Flipped(Valid(new VisitedRay(config)))

  /** From the traversal units. */
  val objectResults = Flipped(Valid(new TraceResult(config)))

  /** The next instance of a ray, or what it has met in all of them. */
  val again   = Valid(new InstanceStep(config))
  val results = Valid(new TraceResult(config))
}

/** Compares the hits of a ray in one instance after the other: the nearest one stays, of equal ones the first. A visit
  * lasts four cycles, with a hit to measure some 20.
  */
final class InstanceResults(config: PathConfig) extends Module {
  private object State extends ChiselEnum { val idle, loading, measuring, leaving = Value }
  import State._

  val io = IO(new InstanceResultsIO(config))

  // Contexts to resolve
  private val visits  = ContextTable(config, new VisitedRay(config))
  private val found   = ContextTable(config, new TraceResult(config))
  private val nearest = ContextTable(config, new NearestHit(config))
  private val waiting = new WaitingContexts(config)
  private val visited = io.visited.bits
  when(io.visited.valid) { visits.write(visited.visit.context, visited) }
  when(io.objectResults.valid) { found.write(io.objectResults.bits.context, io.objectResults.bits) }
  waiting.enter(io.visited.valid && !visited.enters, visited.visit.context)
  waiting.enter(io.objectResults.valid, io.objectResults.bits.context)

  // One of them, and what is known of it
  private val state     = RegInit(idle)
  private val starts    = state === idle && waiting.next.valid
  private val context   = waiting.next.bits
  private val isLoading = state === loading
  private val readRay   = visits.read(context, starts)
  private val readBest  = nearest.read(context, starts)
  private val ray       = RegEnable(readRay, isLoading)
  private val visit     = RegEnable(readRay.visit, isLoading)
  private val result    = RegEnable(found.read(context, starts), isLoading)
  private val best      = Reg(new NearestHit(config))
  waiting.take(starts)
  when(isLoading) {
    best := readBest
    when(readRay.visit.instance === 0.U) {
      best.hasHit    := false.B
      best.occlusion := Occlusion.none
    }
  }

  // Its distance along the ray of the world
  private val isMeasuring = state === measuring
  private val isMeasured  = isMeasuring && ray.enters && !ray.isShadow && result.hasHit
  private val isIssued    = RegInit(false.B)
  private val distance    = Module(new WorldDistance(config)).io
  distance.distance.valid       := isMeasured && !isIssued
  distance.distance.bits.tEntry := ray.tEntry
  distance.distance.bits.t      := result.hit.t
  distance.distance.bits.scale  := ray.scale
  distance.t.ready              := true.B
  when(distance.distance.fire) { isIssued := true.B }
  when(distance.t.valid) {
    isIssued := false.B
    when(distance.t.bits < visit.tMax) {
      visit.tMax    := distance.t.bits
      best.hasHit   := true.B
      best.hit      := result.hit
      best.hit.t    := distance.t.bits
      best.instance := visit.instance
    }
  }
  when(isMeasuring && ray.enters && ray.isShadow && result.occlusion.asUInt > best.occlusion.asUInt) {
    best.occlusion := result.occlusion
  }
  when(starts) { state := loading }
  when(isLoading) { state := measuring }
  when(isMeasuring && (!isMeasured || distance.t.valid)) { state := leaving }
  when(state === leaving) { state := idle }

  // The next visit, or the result
  private val isLast = (visit.instance +& 1.U) === io.count || best.occlusion === Occlusion.opaque
  private val goesOn = state === leaving && !isLast
  when(goesOn) { nearest.write(visit.context, best) }
  io.again.valid            := goesOn
  io.again.bits.context     := visit.context
  io.again.bits.instance    := visit.instance + 1.U
  io.again.bits.tMax        := visit.tMax
  io.results.valid          := state === leaving && isLast
  io.results.bits.context   := visit.context
  io.results.bits.hasHit    := best.hasHit
  io.results.bits.occlusion := best.occlusion
  io.results.bits.hit       := best.hit
  io.results.bits.isClear.foreach(_ := DontCare)
  io.results.bits.instance.foreach(_ := best.instance)
}

/** The nearest hit of a ray so far, with t along the ray of the world; what a shadow ray has met. */
final private class NearestHit(config: PathConfig) extends Bundle {
  val hasHit    = Bool()
  val occlusion = Occlusion()
  val instance  = InstanceNumber(config.device).get
  val hit       = new TriangleHit(config)
}
