package colonnade.shading

import chisel3._
import chisel3.util.Decoupled
import colonnade.config.{ColonnadeConfig, NumberFormats}
import colonnade.formats.{FrameRegisters, Light, Material, Rgb, Shading, Vec3}
import colonnade.numbers.Fixed
import colonnade.ray.{Context, RayFormats}

/** The ports of the shader; the registers are constant while it is busy. */
final class ShaderIO(config: ColonnadeConfig) extends Bundle {
  private val numbers = config.numbers

  val light     = Input(new Light(numbers))
  val unitShift = Input(UInt(NumberFormats.bitLength(numbers.sceneBits).W))
  val ambient   = Input(Rgb(FrameRegisters.intensity))
  val shading   = Input(new Shading)
  val materials = Input(Vec(config.frame.materials, new Material))
  val request   = Flipped(Decoupled(new ShadeRequest(config)))

  /** `request` will be ready in the next cycle. */
  val takesNext = Output(Bool())
  val result    = Decoupled(new ShadeResult(config))

  /** Holds a hit. */
  val busy = Output(Bool())
}

/** Lambert's shading of hits: both colours that a pixel may have and the shadow ray that decides; docs/numbers.md, 5.
  *
  * Results come in order. Two hits are in work, one in the geometry and one in the cosine and its colours; they share a
  * multiplier. At 32b32s64d a hit enters every 41 to 45 cycles (12 more where the smooth normal is zero) and leaves some
  * 85 cycles later. A hit that faces away from the light needs neither root nor quotient.
  */
final class Shader(config: ColonnadeConfig) extends Module {
  private val formats  = new ShaderFormats(config.numbers)
  private val scene    = new RayFormats(config.numbers).scene
  private val lightWay = config.numbers.directionBits

  val io = IO(new ShaderIO(config))

  private val geometry   = Module(new ShaderGeometry(config))
  private val cosine     = Module(new CosineUnit(config.numbers))
  private val colour     = Module(new ColourUnit(config))
  private val multiplier = Module(new ShaderMultiplier(formats))

  /** The hit whose cosine and colours are in work. */
  private val isHeld = RegInit(false.B)
  private val held   = Reg(new HeldHit(config))

  // Geometry
  geometry.io.request <> io.request
  io.takesNext          := geometry.io.takesNext
  geometry.io.isFlat    := io.shading.flat
  geometry.io.light     := io.light
  geometry.io.unitShift := io.unitShift

  // From the geometry to the cosine and the colours, both at once; the rest of the hit is held
  private val point  = geometry.io.result
  private val isFree = !isHeld && cosine.io.angle.ready && colour.io.material.ready
  point.ready              := isFree
  cosine.io.angle.valid    := point.valid && isFree
  cosine.io.angle.bits     := point.bits.angle
  colour.io.material.valid := point.valid && isFree
  colour.io.material.bits  := point.bits.material
  when(point.fire) {
    isHeld              := true.B
    held.context        := point.bits.context
    held.needsShadowRay := io.shading.shadows && point.bits.angle.isAcute
    held.origin         := point.bits.origin
    held.toLight        := point.bits.toLight
  }
  when(io.result.fire)(isHeld := false.B)

  // Colours
  colour.io.cosine <> cosine.io.cosine
  colour.io.materials := io.materials
  colour.io.light     := io.light
  colour.io.ambient   := io.ambient

  // Multiplier
  multiplier.io.geometry := geometry.io.factors
  multiplier.io.colour <> colour.io.factors
  geometry.io.product := multiplier.io.product
  colour.io.product   := multiplier.io.product

  // Result
  private val Seq(originX, originY, originZ)    = held.origin.axes.map(Fixed(scene, _))
  private val Seq(toLightX, toLightY, toLightZ) = held.toLight.axes.map(_.pad(lightWay))
  colour.io.colours.ready       := io.result.ready
  io.result.valid               := colour.io.colours.valid
  io.result.bits.context        := held.context
  io.result.bits.lit            := colour.io.colours.bits.lit
  io.result.bits.ambient        := colour.io.colours.bits.ambient
  io.result.bits.needsShadowRay := held.needsShadowRay
  io.result.bits.origin         := Vec3.of(originX, originY, originZ)
  io.result.bits.toLight        := Vec3.of(toLightX, toLightY, toLightZ)

  io.busy := !geometry.io.request.ready
}

/** What the shader keeps of a hit while its colours are in work. */
private final class HeldHit(config: ColonnadeConfig) extends Bundle {
  private val formats = new ShaderFormats(config.numbers)

  val context        = Context(config)
  val needsShadowRay = Bool()
  val origin         = Vec3(SInt(formats.pointBits.W))
  val toLight        = Vec3(SInt(formats.toLightBits.W))
}
