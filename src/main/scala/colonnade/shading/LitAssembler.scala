package colonnade.shading

import chisel3._
import chisel3.util.{log2Ceil, Decoupled, Valid}
import colonnade.common.{Context, ReservedQueue}
import colonnade.config.PathConfig
import colonnade.formats.{FrameRegisters, Material, Rgb}
import colonnade.numbers.Fixed
import colonnade.ray.RayFormats

/** A surface to light, before its point is known. */
final class SurfaceLabel(config: PathConfig) extends Bundle {
  val context  = Context(config)
  val material = MaterialIndex(config)

  /** Of a point of the environment, which has no material. */
  val environment = if (config.device.hasEnvironment) Some(Valid(Rgb(FrameRegisters.colour))) else None
}

/** A light on a surface, without shadows. */
final class LightOnSurface(config: PathConfig) extends Bundle {
  val light          = UInt(log2Ceil(config.device.frame.lights.max(2)).W)
  val isLast         = Bool()
  val direct         = Rgb(FrameRegisters.intensity)
  val needsShadowRay = Bool()
}

final class LitAssemblerIO(config: PathConfig) extends Bundle {
  val materials = Input(Vec(config.device.frame.materials, new Material(config.device)))

  // For each surface a label and its origin's components; for each light its share. All only while there is space
  val label  = Flipped(Valid(new SurfaceLabel(config)))
  val origin = Vec(3, Flipped(Valid(SInt(ShaderFormats.originBits(config).W))))
  val light  = Flipped(Valid(new LightOnSurface(config)))

  /** The components of the gathered ray's direction. */
  val scatter = new LitSurface(config).scatter.map(_ => Vec(3, Flipped(Valid(ScatterStage.component))))

  val albedo = Flipped(new AlbedoSources(config))

  val isTaken = Output(Bool()) // a light has left
  val lit     = Decoupled(new LitSurface(config))
}

/** Puts surfaces together with their lights, in the order in which they come. A light a cycle; a surface leaves with
  * the last of its lights.
  *
  * @param places of the queues
  */
final class LitAssembler(config: PathConfig, places: Int) extends Module {
  val io = IO(new LitAssemblerIO(config))

  private val labels   = Module(new ReservedQueue(new SurfaceLabel(config), places)).io
  private val lights   = Module(new ReservedQueue(new LightOnSurface(config), places)).io
  private val origins  = io.origin.map(queue(_))
  private val scatters = io.scatter.toSeq.flatten.map(queue(_))
  labels.in          := io.label
  labels.mayTakeNext := lights.validNext
  lights.in          := io.light
  lights.mayTakeNext := true.B

  private val label         = labels.out.bits
  private val light         = lights.out.bits
  private val lit           = io.lit.bits
  private val isEnvironment = label.environment.map(_.valid).getOrElse(false.B)
  private val material      = ShadingPipeline.material(config, io.materials, label.material)
  private val albedo        = new ObjectAlbedo(config, io.albedo, material, !isEnvironment, io.lit.fire, places)
  io.lit.valid     := lights.out.valid && light.isLast && albedo.isKnown
  lights.out.ready := (io.lit.ready && albedo.isKnown) || !light.isLast
  io.isTaken       := lights.out.fire
  private val parts = labels.out +: (origins ++ scatters)
  for (queue <- parts) queue.ready := io.lit.fire
  assert(!io.lit.valid || parts.map(_.valid).reduce(_ && _), "a light without a surface")

  // The lights before the last one
  private val direct = Reg(chiselTypeOf(lit.directLight))
  private val needs  = Reg(chiselTypeOf(lit.needsShadowRays))
  lit.directLight     := direct
  lit.needsShadowRays := needs
  when(light.light === 0.U) {
    lit.directLight     := 0.U.asTypeOf(direct)
    lit.needsShadowRays := 0.U.asTypeOf(needs)
  }
  for (index <- 0 until config.device.frame.lights) when(light.light === index.U) {
    lit.directLight(index)     := light.direct
    lit.needsShadowRays(index) := light.needsShadowRay
  }
  if (config.device.frame.lights > 1) when(lights.out.fire) {
    direct := lit.directLight
    needs  := lit.needsShadowRays
  }

  lit.context := label.context
  lit.albedo  := albedo.albedo
  for (albedo <- label.environment) when(albedo.valid)(lit.albedo := albedo.bits)
  lit.isOfEnvironment := isEnvironment
  for ((to, from) <- lit.emission.zip(material.emission); (channel, value) <- to.channels.zip(from.channels))
    channel                                           := Mux(isEnvironment, 0.U, value)
  for ((to, from) <- lit.origin.axes.zip(origins)) to := Fixed(new RayFormats(config.numbers).scene, from.bits)
  for (scatter <- lit.scatter; (to, from) <- scatter.axes.zip(scatters)) to := from.bits

  /** A queue of what is known before the last light. */
  private def queue[T <: Data](component: Valid[T]) = {
    val queue = Module(new ReservedQueue(component.bits.cloneType, places)).io
    queue.in          := component
    queue.mayTakeNext := lights.validNext
    queue.out
  }
}
