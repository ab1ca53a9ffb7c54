<?xml version="1.0" encoding="utf-8"?>
<!DOCTYPE TS>
<TS version="2.1" language="fr" sourcelanguage="en">
 <context>
  <name>Strandline</name>
  <message>
   <source>the one that 'Check engine' installs</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>none: this computer</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Strandline computes in a Python of its own. Run 'Check engine' from the toolbox to install or test it.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Python of the engine</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Dask scheduler</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>1 Survey</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>2 Surface</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>3 Change</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Tools</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Cancelled.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>There is nothing to write to {}.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>{} is not a survey folder: make one with 'Create survey'.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Check engine</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Tells whether the engine, the Python environment in which Strandline computes, is complete. With 'Install' it is made first: a virtual environment of about 1 GB in the QGIS profile, from the versions that Strandline was tested with. Nothing else in Strandline downloads anything.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Install</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Install or complete the engine before checking it.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Python to use</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>A Python of at least 3.11 to make a new environment with. Empty: one is looked for on this computer.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Folder of wheels</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Install from the Python packages in this folder instead of the network, for computers without one.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>The engine is ready</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>The engine is ready: Python {}, {}.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Installing the engine in {} with {}.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>The engine could not be installed: {} (see the lines above).</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Create survey</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Makes a survey folder for the photographs of one flight: reads size, camera, time and GNSS position from each file, and chooses the CRS. The photographs stay where they are and are never changed. Every later step takes this folder and adds its own files to it.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>The survey is made in QGIS's temporary folder and will be gone when QGIS closes: {}.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Folder of photographs</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Photographs of one flight (JPG, TIFF); sub-folders count.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Only files named</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>A pattern such as *.JPG. Needed when a JPG and a RAW of the same name lie side by side: it picks one kind.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Positions of the photographs</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>A table (a CSV will do) with the fields image, x, y, z and, if known, sigma_h and sigma_v in metres. It replaces the positions in the photographs, for example after PPK processing.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>CRS of these positions</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>CRS of x and y in the table; WGS 84 (longitude, latitude) when left empty.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>CRS of the survey</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Projected CRS of everything made from this survey. Empty: the UTM zone of the positions, if there are any.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Survey folder</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Folder to make. Choose a permanent place: it is the survey.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Photograph positions</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>A point for every photograph with a position.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Photographs</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Photographs with a position</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Standard deviation of each height in metres, from 'Export DSM'.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Standard deviation of the heights in metres, one number, where there is no precision raster.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>DSM difference</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Subtracts two surfaces (after minus before) and sums erosion, deposition and the net volume per zone, each with its standard deviation. That deviation counts noise, errors that neighbours share, and errors common to the whole surface separately. What no surface covers is not extrapolated: the share covered is told.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>DSM before</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>The earlier surface.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>DSM after</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>The later surface; another grid or CRS is resampled to the coarser one.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Nodata value</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>The value of empty cells in both surfaces, where their files do not say it.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Stable ground</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Polygons where nothing changed, such as rock or road: they tell the error of the difference.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Zones</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Polygons to sum volumes in; empty: the overlap of both surfaces.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Field of zone names</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Empty: the field 'name' if there is one, else the feature id.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Areas to ignore</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Polygons left out of everything, such as water or people.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Co-registration</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>How the later surface is brought onto the earlier one on stable ground: not at all (none), by its median height (vertical), by a tilted plane (plane), or also in plan (horizontal); auto chooses what that ground supports.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Level of detection</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>What counts as significant: each cell against its own deviation (cell), one threshold for all (uniform), or cells that agree with their neighbours (coherent).</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Confidence</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Of significance and of the interval of the net volume, between 0 and 1.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Difference</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>After minus before in metres.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Significant difference</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>The difference where it is significant.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Volumes</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>The zones with their volumes in m3 and their deviations.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Precision before</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Precision after</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Deviation before (m)</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Deviation after (m)</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Deviation of the registration (m)</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Of one surface against the other as a whole; used where the stable ground cannot tell.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Range of shared errors (m)</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Up to which distance neighbouring cells err alike; used where the stable ground cannot tell.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Net volume (m3)</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Deviation of the net volume (m3)</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Its part from noise (m3)</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Its part from errors that neighbours share (m3)</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Its part from errors common to the surface (m3)</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Erosion (m3)</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Deviation of the erosion (m3)</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Deposition (m3)</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Deviation of the deposition (m3)</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Significant erosion (m3)</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Significant deposition (m3)</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Significant net volume (m3)</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Area (m2)</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Area covered by both surfaces (%)</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>{0}_PRECISION and {0}_SIGMA exclude each other: give one of them.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Enhance photographs</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Raises the local contrast of bare sand so that tie points can be found on it. The enhanced images serve tie points only: the surface and the orthophoto are always made from the original photographs.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Method</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>arctan: each pixel against the mean and deviation of its window, through an arc tangent (the best on sand); micmac: MicMac's variant; equalize: the image's whole histogram; none: only reduced to 8 bits.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Window</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Side of the square window in pixels, an odd number. Larger windows keep more of the broad shapes.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Polygons of water, people or vehicles; no tie points are sought there. It needs to know where the photographs look: a georeferenced survey, or positions with yaw and height in the photographs.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Export DSM</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Computes the surface of a georeferenced survey by correlating the original photographs, cell by cell, with the precision of each height. Cells that cannot be measured stay empty.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Cell size (m)</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Side of a cell on the ground; 0 is twice the photographs' pixel.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Area</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Only inside these polygons; empty: wherever enough photographs look.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Polygons left empty, such as water or vegetation.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Correlation window</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Side of the window in cells, an odd number; 0 adapts it to the contrast: larger on plain sand.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Regularity</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>How much the surface resists to jump from cell to cell: higher is smoother, 0 lets every cell speak for itself.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Fill gaps up to (m2)</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Gaps up to this area are closed by interpolation and marked in 'Filled cells'; 0 leaves them empty.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>DSM</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Heights in metres, in the survey's CRS.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Precision</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Standard deviation of each height in metres, from matching alone; 'DSM difference' uses it.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Correlation</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>How alike the photographs are at each cell, up to 1.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Views</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>How many photographs measured each cell.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Filled cells</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>1 where the height was interpolated.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Orthophoto</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>The photographs' colours on the surface.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Point cloud</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>The surface as coloured points in a LAZ file.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Ground pixel (m)</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Cells with a height (%)</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Median precision (m)</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>LAZ files (*.laz)</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Georeference</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Brings an oriented survey to the ground with control points, with the positions of the photographs, or with both, and says how well: on control points, on check points that took no part, and by leaving each control point out in turn.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>similarity: shift, rotation and scale alone, the shape of the block stays; adjustment: a bundle adjustment in which the control points also mend the shape.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Use the positions of the photographs</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>The photographs' GNSS positions take part, each with the accuracy it claims.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Lever arm</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>From the GNSS antenna to the camera in metres, three numbers: right, forward, up, of the levelled aircraft.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Heights of the ground points</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>What the ground points' heights refer to: the ellipsoid, or mean sea level (orthometric).</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Heights of the photographs</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>What the heights of the photographs' positions refer to: the ellipsoid, or mean sea level (orthometric).</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Geoid</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>A raster of geoid heights, or one number in metres. Needed when the two kinds of heights differ.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Polygons of water, people or vehicles; tie points in them take no part.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Projected CRS of the results; empty: the survey's own.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Residuals</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>The ground points with their residuals in metres, drawn as arrows.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Camera positions</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Where each photograph was taken from, as computed.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Ground points</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Points surveyed on the ground: control points and check points.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Field of names</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>The field that names each ground point.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Field of heights</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>The field with the height; empty: the Z of the points.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Field of roles</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>The field that says 'control' or 'check'. Check points take no part and tell the accuracy.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Accuracy in plan (m)</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Standard deviation of the ground points in plan.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Accuracy in height (m)</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Standard deviation of the ground points in height.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Field of accuracy in plan</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Where the accuracy differs from point to point.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Field of accuracy in height</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Marks in the photographs</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>A table (a CSV will do) with the fields gcp, image, x, y: where each ground point is seen, in pixels.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>File of ground points and marks</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Instead of both: a gcp_list.txt of OpenDroneMap, or a file of Metashape or MicMac.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Check points</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Names of ground points that shall only check, separated by commas.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Accuracy of the marks (px)</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Standard deviation of a mark.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>GCPS and GCP_FILE exclude each other: give one of them.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>GCPS need NAME_FIELD: name the field with the points' names.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>GCPS need MARKS: give the table of their places in the photographs.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Nothing to georeference with: give GCPS with MARKS, GCP_FILE, or USE_GNSS.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Control points</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Error on control points, plan (m)</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Error on control points, height (m)</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Error on check points, plan (m)</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Error on check points, height (m)</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Error on points left out, plan (m)</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Error on points left out, height (m)</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Residual of the photographs' positions, plan (m)</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Residual of the photographs' positions, height (m)</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Doming (m)</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Orient photographs</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Finds from the tie points where each photograph was taken and how the camera draws, in a free frame without scale. 'Georeference' brings the result to the ground.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Camera model</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>brown: focal length, principal point, two radial and two tangential terms; radial: focal length, principal point, two radial terms; simple_radial: one radial term; full: with rational radial terms, for wide lenses and many photographs.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Calibration from the survey</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Another survey, already oriented, flown with the same camera and focus: its calibration is used.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Use of that calibration</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>prior: a start that may be refined; fixed: kept as it is.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Mapper</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>incremental: photograph by photograph; global: all at once, quicker on large blocks; auto chooses.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Tie points (point cloud)</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>The oriented tie points as a LAZ file, in the free frame.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Oriented photographs</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Mean tie points per photograph</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Tie points kept (%)</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Mean multiple tie points per photograph</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Multiple tie points (%)</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Mean residual (px)</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>How many processes work side by side; 0 is one per processor. Each takes memory: use fewer if it runs short.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Address of a Dask scheduler (tcp://host:8786) to spread the work over several computers. The survey must lie where all of them can reach it. Empty: the one in the options, else this computer.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>A page with the step's numbers and pictures, to keep or send. One is always written to the survey's report folder.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>The folder that 'Create survey' made. The step adds its files to it.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Report</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Processes</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>HTML files (*.html)</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Simulate survey</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Renders the photographs of a flight over an invented beach, with ground points, marks, zones, and the true surfaces and volumes: to learn the steps, to plan a flight, or to see what accuracy to expect.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Dates</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>two: the beach before and after a storm, with the true volumes; one: before only.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Length (m)</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Of the beach, along the shore.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Width (m)</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Of the beach, across the shore.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>CRS</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>A projected CRS in metres; empty: one is chosen.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Flying height (m)</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Above the beach.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Forward overlap (%)</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Of one photograph with the next.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Side overlap (%)</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Of one strip with the next.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Tilt (degrees)</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>How far the camera leans from the plumb line.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Image width (px)</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Pixels across.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Image height (px)</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Pixels down.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Focal length (px)</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Of the camera, in pixels.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Contrast</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Standard deviation of the sand's brightness relative to its mean: 0.04 is dry sand under an even sky.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Noise</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Of the sensor: 1 is a small drone camera at its lowest ISO, 0 is none.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>GNSS accuracy in plan (m)</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Of the photographs' positions.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>GNSS accuracy in height (m)</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Targets laid out as control points.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Targets laid out as check points.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Seed</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>The same number gives the same survey.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Folder</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Folder to make, with photographs, ground points, marks, zones and truth.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Photographs per date</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>True erosion (m3)</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>True deposition (m3)</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>True net volume (m3)</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Find tie points</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Finds features in the photographs and matches them between overlapping ones. The matches that agree with one geometry are kept in features.db, a COLMAP database.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Images</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>auto: the enhanced images if they exist, else the originals with a warning; enhanced; original.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Most features per photograph</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>The strongest features are kept, this many of each photograph; 0 is no limit.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Longest side</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Photographs are reduced to this many pixels on their longer side before features are sought; 0 is full size.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Pairs</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>auto: neighbours by position, or by order and likeness when there are no positions; exhaustive: every pair; sequential: neighbours in the order of the flight.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Mean features per photograph</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Verified pairs</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>Verified matches</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>This is a fault of Strandline in '{}': {}; please report it with the lines above (also in {}).</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>The engine was killed ({}) during '{}', most often for want of memory: use fewer WORKERS; its log is {}.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>The engine crashed ({}) during '{}': its last lines stand above, its whole log is {}.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>exit status {}</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>signal {}</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>The engine's Python {} cannot be started: {}.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>run strandline:checkengine ('Check engine') with INSTALL=true</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>The engine in {} was made for another version of Strandline: {}.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>{} cannot make the engine: PYTHON must be a Python of at least 3.11 with the modules venv and ensurepip.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>No Python of at least 3.11 with the module venv was found: install one (on Debian: apt install python3-venv), or name it in PYTHON.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>STRANDLINE_PYTHON</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>The option 'Python of the engine'</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>The engine of Strandline is not installed: {}.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>run `make setup` in {}, or strandline:checkengine with INSTALL=true</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>{} names {}, which is not there: correct or remove it.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>The raster {} is not a file (it comes from '{}'): save it as a GeoTIFF first.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>The engine's layer {} cannot be read.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>The layer {} cannot be written: {}.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>The field {} of {} cannot be handed to the engine: rename it.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>The feature {} of {} cannot be handed to the engine.</source>
   <translation type="unfinished" />
  </message>
  <message>
   <source>{} is not a CRS that QGIS knows: {}.</source>
   <translation type="unfinished" />
  </message>
 </context>
</TS>
