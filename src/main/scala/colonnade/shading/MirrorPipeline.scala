package colonnade.shading

import chisel3._
import chisel3.util.{log2Ceil, Cat, PriorityEncoder, Reverse}
import colonnade.common.ModuloSchedule.{interval, xyz}
import colonnade.common.{Context, ModuloSchedule, ReservedQueue}
import colonnade.config.{NumberFormats, PathConfig}
import colonnade.formats.Vec3
import colonnade.numbers.Rounding

/** A hit on a mirror in [[MirrorPipeline]]. */
final private[shading] class MirrorHit(config: PathConfig) extends Bundle {
  private val formats = new BounceFormats(config.numbers)

  val context           = Context(config)
  val isSmooth          = Bool()
  val normal            = Vec(3, SInt(formats.componentBits.W))
  val faceForwardNormal = Vec(3, SInt(formats.faceForwardBits.W))
  val dir               = Vec(3, SInt(formats.componentBits.W))
}

/** Reflections at mirrors, equal to [[BounceUnit]]'s: a hit every three cycles, in order but for restarts. {{{
  *
  * request ─▶ n·n, n·d ─▶ |n|²·d + 2c·n ─▶ hemisphere check ─▶ queue ─▶ result
  *      ▲                                        │ with the geometric normal
  *      └────────────────────────────────────────┘
  * }}}
  * The stages follow a [[colonnade.common.ModuloSchedule]], an axis a cycle, and never stall: a hit enters only if it
  * has a place in the queue. A result is offered 14 cycles after its request was taken; a restart takes 12 cycles more.
  */
final class MirrorPipeline(config: PathConfig) extends Module {
  private val formats   = new BounceFormats(config.numbers)
  private val shadeBits = formats.shadeBits
  private val dotBits   = 2 * shadeBits + 2

  val io = IO(new BounceUnitIO(config)) // `request.bits.isGlass` is false; the ports of glass have no effect

  private val phase    = RegInit(0.U.asTypeOf(ModuloSchedule.phase()))
  private val schedule = new ModuloSchedule(phase)
  import schedule._
  private val enters = isAt(interval - 1)
  phase := Mux(enters, 0.U, phase + 1.U)

  // The hit, an interval in each register
  private val isHeld   = RegInit(VecInit.fill(4)(false.B))
  private val entering = Wire(new MirrorHit(config))
  private val hit      = Reg(new MirrorHit(config))
  private val hits     = Seq.iterate(arriving(hit, 0, interval - 1), 4)(hit => latch(hit.last)(hit.at(hit.last)))

  private def hitAt(cycle: Int): MirrorHit = hits(cycle / interval).at(cycle)

  /** The axes of a vector of the hit, one after the other. */
  private def axes[T <: Data](first: Int)(vector: MirrorHit => Vec[T]): T =
    select(xyz(first))(axis => vector(hitAt(first + axis))(axis))

  // Lengths and angle
  private val squareOf = latch(xyz(0))(axes(0)(_.normal) * axes(0)(_.normal)).at(xyz(1))
  private val angleOf  = latch(xyz(0))(axes(0)(_.normal) * axes(0)(_.dir)).at(xyz(1))
  private val square   = Reg(UInt(dotBits.W))
  private val against  = Reg(SInt((dotBits + 1).W))
  square  := Mux(isAt(1), 0.U, square) + squareOf.asUInt
  against := Mux(isAt(1), 0.S, against) -& angleOf
  private val top       = square(dotBits - 1, dotBits - 3)
  private val exponent  = Mux(top.orR, 3.U - PriorityEncoder(Reverse(top)), 0.U)
  private val turnsAway = carry(latch(4)(against <= 0.S), 11)

  private def scaled(length: UInt) = Rounding.floor(Rounding.floor(length, shadeBits - 1), exponent)

  private val scale  = latch(4)(scaled(square)(shadeBits - 1, 0))
  private val cosine = latch(4) {
    Mux(against > 0.S, scaled(against.asUInt(dotBits - 1, 0))(formats.cosineBits - 1, 0), 0.U)
  }

  // The direction
  private val ofRay     = latch(xyz(5))(scale.at(xyz(5)).zext * axes(5)(_.dir)).at(xyz(6))
  private val ofNormal  = latch(xyz(5))(Cat(cosine.at(xyz(5)), 0.U(1.W)).zext * axes(5)(_.normal)).at(xyz(6))
  private val component = Rounding.narrow(Rounding.floor(ofRay +& ofNormal, shadeBits - 4), formats.bounceBits)
  private val latest    = xyz(6).map(cycle => latch(cycle)(component))

  // Hemisphere check, in the hit's last cycle
  private val dir     = select(xyz(7))(axis => latest(axis).at(7 + axis))
  private val checked = latch(xyz(7))(dir * axes(7)(_.faceForwardNormal)).at(xyz(8))
  private val side    = Reg(SInt((formats.bounceBits + formats.faceForwardBits + 2).W))
  side := Mux(isAt(8), 0.S, side) + checked
  private val last     = hitAt(11)
  private val ends     = enters && isHeld.last
  private val isWrong  = last.isSmooth && (turnsAway.at(11) || side <= 0.S)
  private val restarts = isHeld.last && isWrong

  // Enter with a place in the queue, or again
  private val count    = RegInit(0.U(log2Ceil(MirrorPipeline.places + 1).W))
  private val hasPlace = count =/= MirrorPipeline.places.U
  count            := count + io.request.fire - io.result.fire
  io.request.ready := enters && hasPlace && !restarts
  io.busy          := count =/= 0.U
  when(enters) {
    hit    := entering
    isHeld := VecInit((io.request.fire || restarts) +: isHeld.init)
  }
  entering.context           := io.request.bits.context
  entering.isSmooth          := io.request.bits.isSmooth
  entering.normal            := VecInit(io.request.bits.normal.axes)
  entering.faceForwardNormal := VecInit(io.request.bits.faceForwardNormal.axes)
  entering.dir               := VecInit(io.request.bits.dir.axes)
  when(restarts) {
    entering          := last
    entering.isSmooth := false.B
    entering.normal   := VecInit(MirrorPipeline.normalised(last.faceForwardNormal, shadeBits))
  }

  // Results
  private val queue = Module(new ReservedQueue(new MirrorResult(config), MirrorPipeline.places)).io
  queue.in.valid        := ends && !isWrong
  queue.in.bits.context := last.context
  queue.in.bits.dir     := VecInit(latest.map(carry(_, 11).at(11)))
  queue.out.ready       := io.result.ready
  queue.mayTakeNext     := true.B
  private val result = queue.out.bits
  io.result.valid             := queue.out.valid
  io.result.bits.context      := result.context
  io.result.bits.isRefraction := false.B
  io.result.bits.fresnel.raw  := 0.U
  io.result.bits.origin       := DontCare
  io.result.bits.dir          := Vec3.of(result.dir)
  io.result.bits.reflection   := Vec3.of(result.dir)
}

/** A reflection that waits. */
final private[shading] class MirrorResult(config: PathConfig) extends Bundle {
  val context = Context(config)
  val dir     = Vec(3, SInt(new BounceFormats(config.numbers).bounceBits.W))
}

object MirrorPipeline {
  val places: Int = 8 // reflections in work or waiting: the queue never delays one that is taken at once

  /** A stored normal whose largest component gets `bits` bits. */
  private def normalised(normal: Seq[SInt], bits: Int): Seq[SInt] = {
    val longest = normal.map(x => Mux(x < 0.S, 0.S -& x, x).asUInt).reduce(_ | _)(NumberFormats.normalBits - 1, 0)
    val shift   = PriorityEncoder(Reverse(longest))
    normal.map(x => Rounding.narrow((x << (bits - NumberFormats.normalBits) << shift).asSInt, bits + 1))
  }
}
