package colonnade.shading

import chisel3._
import chisel3.util.{Cat, MuxLookup, PriorityEncoder, Reverse}
import colonnade.common.{Context, ContextTable}
import colonnade.config.{ColonnadeConfig, NumberFormats}
import colonnade.numbers.{Fixed, Rounding}
import colonnade.ray.RayFormats

/** A hit on a mirror in [[MirrorPipeline]]. */
final private[shading] class MirrorHit(config: ColonnadeConfig) extends Bundle {
  private val formats = new BounceFormats(config.numbers)

  val context           = Context(config)
  val isSmooth          = Bool()
  val normal            = Vec(3, SInt(formats.componentBits.W))
  val faceForwardNormal = Vec(3, SInt(formats.faceForwardBits.W))
  val dir               = Vec(3, SInt(formats.componentBits.W))
}

/** Reflections at mirrors, equal to those of [[BounceUnit]]: a hit every five cycles, in order but for restarts. {{{
  *
  * request ─▶ n·n, n·d ─▶ |n|²·d + 2c·n ─▶ hemisphere check ─▶ result
  *      ▲                                        │ with the geometric normal
  *      └────────────────────────────────────────┘
  * }}}
  * All stages are in step: three cycles for the axes, two for the sums. A result is offered 14 cycles after its request was
  * taken; a restart takes 15 cycles more.
  */
final class MirrorPipeline(config: ColonnadeConfig) extends Module {
  private val formats   = new BounceFormats(config.numbers)
  private val shadeBits = formats.shadeBits
  private val dotBits   = 2 * shadeBits + 2
  private val scene     = new RayFormats(config.numbers).scene

  /** `request.bits.isGlass` is false; the ports of glass have no effect. */
  val io = IO(new BounceUnitIO(config))

  private val first, second, third          = Reg(new MirrorHit(config))
  private val hasFirst, hasSecond, hasThird = RegInit(false.B)
  private val phase                         = RegInit(4.U(3.W))
  private val isEmpty                       = !hasFirst && !hasSecond && !hasThird

  /** The axis of a phase. */
  private def axis[T <: Data](vector: Seq[T], offset: Int = 0): T =
    MuxLookup(phase, vector(2))(Seq(offset.U -> vector(0), (offset + 1).U -> vector(1)))

  // First stage: lengths and angle
  private val square   = Reg(UInt(dotBits.W))
  private val against  = Reg(SInt((dotBits + 1).W))
  private val squareOf = Reg(SInt(dotBits.W))
  private val angleOf  = Reg(SInt(dotBits.W))

  // Second stage: the direction, an axis at a time
  private val scale      = Reg(UInt(shadeBits.W))
  private val cosine     = Reg(UInt(formats.cosineBits.W))
  private val turnsAway  = Reg(Vec(2, Bool())) // of the second stage, of the third
  private val ofRay      = Reg(SInt((2 * shadeBits + 2).W))
  private val ofNormal   = Reg(SInt((2 * shadeBits + 4).W))
  private val reflection = Reg(Vec(3, SInt(formats.bounceBits.W)))

  // Hemisphere check
  private val checkBits = formats.bounceBits + formats.faceForwardBits
  private val checked   = Reg(SInt(checkBits.W))
  private val side      = Reg(SInt((checkBits + 2).W))

  // The result waits until it is taken; its origin comes from a table
  private val hasResult = RegInit(false.B)
  private val result    = Reg(new MirrorResult(config))
  private val isWrong   = third.isSmooth && (turnsAway(1) || side <= 0.S)
  private val ends      = phase === 1.U && hasThird && !isWrong
  private val stalls    = ends && hasResult
  private val enters    = phase === 4.U
  private val restarts  = hasThird // has not ended

  when(!stalls) {
    phase := Mux(enters, Mux(isEmpty && !io.request.valid, 4.U, 0.U), phase + 1.U)

    // Products of axes 0, 1, 2 in phases 0, 1, 2; their sums are complete in phase 4
    squareOf := axis(first.normal) * axis(first.normal)
    angleOf  := axis(first.normal) * axis(first.dir)
    when(phase =/= 4.U) {
      square  := Mux(phase === 1.U, 0.U, square) + squareOf.asUInt
      against := Mux(phase === 1.U, 0.S, against) -& angleOf
    }

    ofRay    := scale.zext * axis(second.dir)
    ofNormal := Cat(cosine, 0.U(1.W)).zext * axis(second.normal)
    // The axes enter in phases 1, 2, 3
    when(phase === 1.U || phase === 2.U || phase === 3.U) {
      reflection(0) := reflection(1)
      reflection(1) := reflection(2)
      reflection(2) := Rounding.narrow(Rounding.floor(ofRay +& ofNormal, shadeBits - 4), formats.bounceBits)
    }

    // The new axis in phases 2, 3, 4; the sum is complete in phase 1 of the third stage
    checked := reflection(2) * axis(second.faceForwardNormal, 2)
    side    := Mux(phase === 3.U, 0.S, side) + checked
  }

  // Move on
  private val top        = square(dotBits - 1, dotBits - 3)
  private val exponent   = Mux(top.orR, 3.U - PriorityEncoder(Reverse(top)), 0.U)
  private val isAcute    = against > 0.S
  private val scaleNext  = Rounding.floor(Rounding.floor(square, shadeBits - 1), exponent)
  private val cosineNext = Rounding.floor(Rounding.floor(against.asUInt(dotBits - 1, 0), shadeBits - 1), exponent)
  when(enters) {
    hasFirst  := io.request.valid || restarts
    hasSecond := hasFirst
    hasThird  := hasSecond
    second    := first
    third     := second
    scale     := scaleNext(shadeBits - 1, 0)
    cosine    := Mux(isAcute, cosineNext(formats.cosineBits - 1, 0), 0.U)
    turnsAway := VecInit(!isAcute, turnsAway(0))

    first.context  := io.request.bits.context
    first.isSmooth := io.request.bits.isSmooth
    for (axis <- 0 until 3) {
      first.normal(axis)            := io.request.bits.normal.axes(axis)
      first.faceForwardNormal(axis) := io.request.bits.faceForwardNormal.axes(axis)
      first.dir(axis)               := io.request.bits.dir.axes(axis)
    }
    when(restarts) {
      first          := third
      first.isSmooth := false.B
      first.normal   := VecInit(MirrorPipeline.normalised(third.faceForwardNormal, shadeBits))
    }
  }
  io.request.ready := enters && !restarts
  io.busy          := !isEmpty || hasResult
  when(ends && !stalls) { hasThird := false.B }

  // Results
  private val origins = ContextTable(config, new BounceRequest(config).origin.cloneType)
  when(io.request.fire) { origins.write(io.request.bits.context, io.request.bits.origin) }
  private val origin = origins.read(result.context, hasResult)
  private val isRead = RegNext(hasResult && !io.result.fire, false.B)
  when(ends && !stalls) {
    hasResult      := true.B
    result.context := third.context
    result.dir     := reflection
  }.elsewhen(io.result.fire) { hasResult := false.B }
  io.result.valid             := isRead
  io.result.bits.context      := result.context
  io.result.bits.isRefraction := false.B
  io.result.bits.fresnel.raw  := 0.U
  for (axis <- 0 until 3) {
    io.result.bits.origin.axes(axis)     := Fixed(scene, origin.axes(axis))
    io.result.bits.dir.axes(axis)        := result.dir(axis)
    io.result.bits.reflection.axes(axis) := result.dir(axis)
  }
}

/** A reflection that waits. */
final private[shading] class MirrorResult(config: ColonnadeConfig) extends Bundle {
  val context = Context(config)
  val dir     = Vec(3, SInt(new BounceFormats(config.numbers).bounceBits.W))
}

object MirrorPipeline {

  /** A stored normal whose largest component gets `bits` bits. */
  private def normalised(normal: Seq[SInt], bits: Int): Seq[SInt] = {
    val longest = normal.map(x => Mux(x < 0.S, 0.S -& x, x).asUInt).reduce(_ | _)(NumberFormats.normalBits - 1, 0)
    val shift   = PriorityEncoder(Reverse(longest))
    normal.map(x => Rounding.narrow((x << (bits - NumberFormats.normalBits) << shift).asSInt, bits + 1))
  }
}
