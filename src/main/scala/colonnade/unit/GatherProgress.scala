package colonnade.unit

import chisel3._
import chisel3.util.RegEnable
import colonnade.common.Choice
import colonnade.config.PathConfig
import colonnade.formats.Gather
import colonnade.shading.Occlusion

/** What [[RtController]] knows of the rays that the path of each context gathered: none. [[GatheringPaths]] is for a
  * device with gathered light.
  */
private[unit] class GatherProgress {
  def isBuilt: Bool = false.B // contexts may gather
  def isOn: Bool    = false.B // in this frame

  /** The path has gathered. It meets the light cube, not the environment. */
  def hasGathered(context: UInt): Bool = false.B

  /** The surface at which the path ends may gather; it is of the environment, or may be, if the camera sees it. */
  def mayGather(choice:       Choice): Bool = false.B
  def isOfEnvironment(choice: Choice): Bool = true.B

  /** The shadow rays of a point of the environment before it gathered, given its path's. */
  def before(choice: Choice, occlusions: Seq[Occlusion.Type]): Seq[Occlusion.Type] = occlusions

  /** Each to be called once: a path starts; a surface is known; its gathered ray is issued, after its shadow rays. */
  def start(valid:  Bool, context: UInt): Unit                                       = ()
  def shade(shaded: Shaded, valid: Bool): Unit                                       = ()
  def issue(valid:  Bool, choice:  Choice, occlusions: => Seq[Occlusion.Type]): Unit = ()
}

/** With gathered light. */
final private class GatheringPaths(config: PathConfig, io: GatherControl) extends GatherProgress {
  private val isScattered = Reg(Vec(config.contexts, Bool()))
  private val count       = new FlagTable(config, UInt(Gather.countBits.W))

  /** With an environment: the surface is of it; what the shadow rays of a point met, while its gathered rays are traced. */
  private val ofEnvironment = Option.when(config.device.hasEnvironment)(new FlagTable(config, Bool()))
  private val results       = Vec(config.device.frame.lights, UInt(Occlusion.getWidth.W))
  private val kept          = Option.when(config.device.hasEnvironment)(new FlagTable(config, UInt(results.getWidth.W)))

  // In the cycle after its request, the rays that a path has gathered
  private val sampled = Choice(RegEnable(io.sample, io.sample.valid), io.sample)
  io.count := Mux(RegEnable(isScattered(io.sample.bits), io.sample.valid), count.read(sampled), 0.U)

  override def isBuilt: Bool = true.B
  override def isOn: Bool    = io.bounces =/= 0.U

  override def hasGathered(context: UInt): Bool = isScattered(context)

  override def mayGather(choice: Choice): Bool =
    Mux(isScattered(choice.now.bits), count.read(choice) < io.bounces, isOn)

  override def isOfEnvironment(choice: Choice): Bool = ofEnvironment.map(_.read(choice).asBool).getOrElse(false.B)

  override def before(choice: Choice, occlusions: Seq[Occlusion.Type]): Seq[Occlusion.Type] =
    kept.fold(occlusions)(_.read(choice).asTypeOf(results).map(Occlusion.safe(_)._1))

  override def start(valid: Bool, context: UInt): Unit = when(valid) { isScattered(context) := false.B }

  override def shade(shaded: Shaded, valid: Bool): Unit =
    ofEnvironment.foreach(_.write(valid, shaded.context, shaded.isOfEnvironment))

  override def issue(valid: Bool, choice: Choice, occlusions: => Seq[Occlusion.Type]): Unit = {
    val context = choice.now.bits
    val isFirst = !isScattered(context)
    count.write(valid, context, Mux(isFirst, 1.U, count.read(choice) + 1.U))
    kept.foreach(_.write(valid && isFirst, context, VecInit(occlusions).asUInt))
    when(valid) { isScattered(context) := true.B }
  }
}

private[unit] object GatherProgress {
  def apply(config: PathConfig, io: Option[GatherControl]): GatherProgress =
    io.fold(new GatherProgress)(new GatheringPaths(config, _))
}
