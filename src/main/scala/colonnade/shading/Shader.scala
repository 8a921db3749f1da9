package colonnade.shading

import chisel3._
import chisel3.util.Decoupled
import colonnade.config.{NumberFormats, PathConfig, UnitsConfig}
import colonnade.formats.{Light, Material, Shading}

/** Ports of [[Shader]]; the registers are constant while it is busy. */
final class ShaderIO(config: PathConfig) extends Bundle {
  private val numbers = config.numbers

  val lights    = Input(Vec(config.frame.lights, new Light(numbers)))
  val unitShift = Input(UInt(NumberFormats.bitLength(numbers.sceneBits).W))
  val shading   = Input(new Shading(config))
  val materials = Input(Vec(config.frame.materials, new Material(config)))
  val request   = Flipped(Decoupled(new ShadeRequest(config)))

  /** Points of the environment; taken when there is no request. */
  val environment = if (config.hasEnvironment) Some(Flipped(Decoupled(new EnvironmentSurface(config)))) else None

  val readyNext = Output(Bool()) // `request` is ready in the next cycle

  /** To the textures, and whether a texel was illegal. */
  val texture        = config.geometry.texture.map(_ => new TexturePort(config))
  val isIllegalTexel = config.geometry.texture.map(_ => Output(Bool()))

  /** A hit on a diffuse surface asks for its sample point. */
  val sample = Option.when(config.frame.gather)(new SamplePort(config))

  val lit     = Decoupled(new LitSurface(config))                                       // hits on diffuse surfaces
  val bounced = Option.when(config.frame.hasBounces)(Decoupled(new BouncedRay(config))) // hits on mirrors and glass
  val busy = Output(Bool()) // the entry holds a hit: a cycle of the narrowest stage
}

/** Shades hits: docs/numbers.md, 5 and 6. Lit surfaces leave in the order of their hits. */
abstract class Shader(config: PathConfig) extends Module {
  final val io = IO(new ShaderIO(config))

  /** A light's entry; a single light needs no index. */
  protected def at[T <: Data](entries: Vec[T], index: UInt): T =
    if (config.frame.lights == 1) entries.head else entries(index)
}

object Shader {

  /** The smallest unit that takes a light on a hit every `units.shadeInterval` cycles. */
  def apply(config: PathConfig): Shader =
    if (config.units.shadeInterval >= UnitsConfig.sequentialShadeInterval) new SequentialShader(config)
    else new ShadingPipeline(config)
}
