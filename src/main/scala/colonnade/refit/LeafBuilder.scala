package colonnade.refit

import chisel3._
import chisel3.util._
import colonnade.config.ColonnadeConfig
import colonnade.formats._

/** A leaf's record and its bounds, or the entry of a node. */
final class RefitItem(config: ColonnadeConfig) extends Bundle {
  val entry  = new RefitEntry(config)
  val record = new RecordFormats(config).record
  val low    = Vec3(UInt(config.geometry.vertexBits.W))
  val high   = Vec3(UInt(config.geometry.vertexBits.W))
  val isFlat = Bool() // a pair without normals

  def isNode: Bool = entry.kind === RefitKind.node
}

/** Puts leaves together, a vertex a cycle; passes nodes on. */
final class LeafBuilder(config: ColonnadeConfig) extends Module {
  val steps = IO(Flipped(Decoupled(new RefitStep(config))))
  val items = IO(Decoupled(new RefitItem(config)))

  private val geometry  = config.geometry
  private val deltaBits = LeafRecord.deltaBits(geometry)
  private val entry     = Reg(new RefitEntry(config))
  private val vertices  = Reg(Vec(Leaf.maxVertices, new RefitVertex(config)))
  private val deltas    = Reg(Vec(Leaf.maxVertices, Vec3(SInt((deltaBits + 1).W)))) // from vertex 0
  private val fits      = Reg(Vec(2, Bool()))                                       // all deltas fit a near, a far pair
  private val low       = Reg(Vec3(UInt(geometry.vertexBits.W)))
  private val high      = Reg(Vec3(UInt(geometry.vertexBits.W)))
  private val isWhole   = RegInit(false.B)
  private val step      = steps.bits

  steps.ready := !isWhole || items.ready
  when(steps.ready) { isWhole := steps.valid && step.isLast }
  when(steps.fire) {
    val isFirst = step.index === 0.U
    val moved   = step.vertex.position.axes.zip(vertices.head.position.axes).map { case (to, from) =>
      to.zext - from.zext
    }
    entry                := step.entry
    vertices(step.index) := step.vertex
    deltas(step.index).axes.zip(moved).foreach { case (delta, value) => delta := value }
    for ((fit, more) <- fits.zipWithIndex) {
      val isShort = moved.map(value => (value >> (deltaBits + more - 1)).asUInt).map(top => top.andR || !top.orR)
      fit := isFirst || (fit && isShort.reduce(_ && _))
    }
    for (((least, most), value) <- low.axes.zip(high.axes).zip(step.vertex.position.axes)) {
      when(isFirst || value < least) { least := value }
      when(isFirst || value > most) { most := value }
    }
  }

  // The record in its format
  private val near                                                       = Wire(LeafRecord.nearPair(geometry))
  private val far                                                        = Wire(LeafRecord.farPair(geometry))
  private val flat                                                       = Wire(LeafRecord.flatPair(geometry))
  private val triangle                                                   = Wire(LeafRecord.triangle(geometry))
  private def head[T <: Data](record: LeafRecord[T], format: UInt): Unit = {
    record.format   := format
    record.isClear  := entry.isClear
    record.material := entry.material
    record.unused.foreach(_ := 0.U)
  }
  head(near, LeafFormat.nearPair)
  head(far, LeafFormat.farPair)
  head(flat, LeafFormat.flatPair)
  head(triangle, LeafFormat.triangle)
  near.body.vertex := vertices.head.position
  far.body.vertex  := vertices.head.position
  for (i <- 0 until Leaf.maxVertices) {
    val normal = vertices(i).normal
    for (
      (code, high, low) <- Seq[(SInt, Octahedral[SInt] => SInt, Octahedral[Bool] => Bool)](
        (normal.u, _.u, _.u),
        (normal.v, _.v, _.v)
      )
    ) {
      Seq(near.body.normals, far.body.normals).foreach(normals => high(normals(i)) := code >> 1)
      low(near.body.lowBits(i)) := code(0)
    }
    flat.body.vertices(i) := vertices(i).position
    if (i < 3) {
      triangle.body.vertices(i) := vertices(i).position
      triangle.body.normals(i)  := normal
    }
    if (i > 0) for (axis <- 0 until 3) {
      val delta = deltas(i).axes(axis).asUInt
      near.body.deltas(i - 1).axes(axis) := delta(deltaBits - 1, 0).asSInt
      far.body.deltas(i - 1).axes(axis)  := delta
      far.body.signs(i - 1).axes(axis)   := delta(deltaBits)
    }
  }
  private val isPair = entry.kind === RefitKind.pair
  private val isFlat = isPair && !fits(1)
  items.valid       := isWhole
  items.bits.entry  := entry
  items.bits.low    := low
  items.bits.high   := high
  items.bits.isFlat := isFlat
  items.bits.record := Mux(
    !isPair,
    triangle.asUInt,
    Mux(fits(0), near.asUInt, Mux(isFlat, flat.asUInt, far.asUInt))
  )
}
