package colonnade.unit

import colonnade.config.ColonnadeConfig
import colonnade.environment.{EnvironmentScene, ViewCase}

import scala.util.Random

/** The environment of a small scene, with the camera of its maps. Pixels in a strip at the left and the top of the
  * frame are marked as unable to show the object.
  *
  * @param hasEnvironment the frame has an environment; otherwise only the maps are loaded
  * @param occlusion      the environment may hide the object, which is then larger, and partly behind the walls
  * @param isMapCamera    the frame's camera is that of the maps; otherwise it stands aside and behind
  */
final class SmallEnvironment(
    config:         ColonnadeConfig,
    scene:          SmallScene,
    random:         Random,
    frame:          Seq[Int],
    hasEnvironment: Boolean,
    occlusion:      Boolean,
    isMapCamera:    Boolean = true
) {
  private val numbers = config.numbers
  private val maps    = new EnvironmentScene(config, random)
  private val sizes   = Seq(config.physicalAttributeMemory.get.width, config.physicalAttributeMemory.get.height)

  /** Words by memory name. */
  val words: Map[String, Seq[BigInt]] = maps.words

  /** Registers of scene and environment; the object is 1.1 m across, and as far away. */
  val registers: Map[String, BigInt] = {
    val unitShift = scene.registers("frame.unitShift").toInt
    val stepShift = scene.registers("camera.stepShift").toInt
    val forwards  = scene.registers("camera.direction.z") << stepShift
    val camera    = "xyz".map(axis => scene.registers(s"camera.position.$axis") << unitShift)
    val metre     = (BigInt(1) << (numbers.vertexBits + numbers.gridFraction)).toDouble / (if (occlusion) 2.6 else 1.1)
    val axes      = Seq(Seq(1.0, 0, 0), Seq(0, -1.0, 0), Seq(0, 0, 1.0))
    val moved     = if (isMapCamera) Seq(0.0, 0.0, 0.0) else Seq(0.15, -0.05, 0.1)
    val ofMaps    = camera.zip(moved).map { case (from, by) => from + BigDecimal(by * metre).toBigInt }
    val view      = ViewCase.of(
      config,
      maps.focal,
      maps.middle,
      axes,
      ofMaps,
      metre,
      ViewCase.stepWidths(config, frame)
    )
    def scaled(slope: Double): BigInt = BigDecimal(slope * forwards.toDouble).toBigInt
    val steps                         = Seq(0, 1).map(axis => sizes(axis).toDouble / frame(axis) / maps.focal)
    val corner                        = Seq(0, 1).map(axis => steps(axis) / 2 - maps.middle(axis) / maps.focal)
    // The light is close to the camera, so that the object's shadow is visible
    val light = "xyz".zip(camera.zip(Seq(-0.6, 0.25, 0.2))).map { case (axis, (from, by)) =>
      s"lights[0].position.$axis" -> ((from + BigDecimal(by * metre).toBigInt) >> unitShift)
    }
    scene.registers ++ light ++ view.copy(isMapCamera = isMapCamera).fields.map { case (name, value) =>
      s"environment.$name" -> value
    } ++ Map[
      String,
      BigInt
    ](
      "environment.enabled"            -> (if (hasEnvironment) 1 else 0),
      "environment.window.x0"          -> 0,
      "environment.window.y0"          -> 0,
      "environment.window.x1"          -> frame(0),
      "environment.window.y1"          -> frame(1),
      "environment.occlusion"          -> (if (occlusion) 1 else 0),
      "environment.occlusionTolerance" -> BigDecimal(0.02 * metre).toBigInt,
      "camera.direction.x"             -> (scaled(corner(0)) >> stepShift),
      "camera.direction.y"             -> (scaled(-corner(1)) >> stepShift),
      "camera.stepX.x"                 -> scaled(steps(0)),
      "camera.stepY.y"                 -> scaled(-steps(1)),
      "frame.objectRect.x0"            -> (if (hasEnvironment) 2 else 0),
      "frame.objectRect.y0"            -> (if (hasEnvironment) 1 else 0)
    )
  }
}
